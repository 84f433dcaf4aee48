use super::super::testing::stored;
use super::*;

#[test]
fn a_budget_is_never_exceeded_and_nearly_spent() {
    let (_, dictionary, patterns) = stored(3);
    for share in [0.1, 0.37, 0.5, 0.9] {
        let budget = (share * dictionary.bytes() as f64) as usize;
        let retained = retained_grains(&dictionary, &patterns, &|_| true, budget, 220);
        let left = reduced(&dictionary, &patterns, &retained, 220);
        assert!(left.dictionary.bytes() <= budget);
        // Grains of no use are not added.
        assert!(share > 0.5 || left.dictionary.bytes() + 9000 > budget);
        left.patterns.validate(&left.dictionary).unwrap();
    }
    assert!(!retained_grains(&dictionary, &patterns, &|_| true, 100, 220).contains(&true));
    let all = retained_grains(&dictionary, &patterns, &|_| true, usize::MAX, 220);
    // Without a limit, each passage has a grain that is as good as the best.
    for slot in patterns.patterns.iter().flat_map(|p| slots_of(p, &dictionary)) {
        let best = slot.candidates.iter().find(|(grain, _)| all[*grain as usize]);
        assert!(best.is_some_and(|(_, ratio)| *ratio >= slot.candidates[0].1));
    }
}

#[test]
fn grains_of_the_chosen_recordings_come_first() {
    let (_, dictionary, patterns) = stored(3);
    let chosen = |pattern: &Pattern| pattern.name == "impacts_1.wav";
    let budget = dictionary.bytes() / 4;
    let retained = retained_grains(&dictionary, &patterns, &chosen, budget, 220);
    let of = |source: u32| {
        let own = dictionary.grains.iter().zip(&retained).filter(|(g, _)| g.source == source);
        own.filter(|(_, r)| **r).count()
    };
    assert!(of(1) > 2 * (of(0) + of(2)), "{} {} {}", of(0), of(1), of(2));
}

#[test]
fn the_lazy_choice_is_that_of_trying_every_grain() {
    let (_, dictionary, patterns) = stored(2);
    let budget = dictionary.bytes() / 2;
    let lazy = retained_grains(&dictionary, &patterns, &|_| true, budget, 220);
    // The definition: each time the grain of the greatest gain for its bytes of all that fit.
    let slots: Vec<Slot> = patterns.patterns.iter().flat_map(|p| slots_of(p, &dictionary)).collect();
    let mut retained = vec![false; dictionary.len()];
    let value = |retained: &[bool]| -> f64 {
        let of_slot = |slot: &Slot| {
            let left = slot.candidates.iter().filter(|(g, _)| retained[*g as usize]);
            slot.len * left.map(|(_, r)| *r).fold(0.0, f64::max)
        };
        slots.iter().map(of_slot).sum()
    };
    let bytes = |retained: &[bool]| dictionary.subset(retained, 220).bytes();
    let mut is_tried = vec![false; dictionary.len()];
    loop {
        let (now, spent) = (value(&retained), bytes(&retained));
        let offers = (0..dictionary.len()).filter(|k| !retained[*k] && !is_tried[*k]).map(|k| {
            let mut with = retained.clone();
            with[k] = true;
            ((value(&with) - now) / (bytes(&with) - spent) as f64, k, bytes(&with))
        });
        let best = offers.filter(|o| o.0 > 1e-12).max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let Some((_, k, with)) = best else { break };
        if with <= budget { retained[k] = true } else { is_tried[k] = true }
    }
    assert_eq!(lazy, retained);
}
