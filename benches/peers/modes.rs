//! Item 10: Banks of 64, 1000 and 10,000 modes at 44.1 kHz in blocks of 64 samples with an impulse in every 16th, in single precision.
//!
//! `modes` is the default form of foley's bank: in blocks without an impulse the arithmetic that is called `direct` elsewhere, the two-pole
//! recursion, and in blocks with one a phasor for each mode, which is called `coupled`. `frames-hop512` is the form by Fourier transforms with 5 bins; unlike
//! the figure of that name elsewhere it includes the transforms and the overlap.

use super::measure::Item;
use foley_nodes::modal::{Bank, BankForm, BankOutput, Modes};

const RATE: f64 = 44_100.0;
const BLOCK: usize = 64;
/// Blocks from one impulse to the next.
const INTERVAL: usize = 16;

fn modes(n: usize) -> Modes {
    let frequency = |k: usize| 60.0 * (16_000.0_f64 / 60.0).powf(k as f64 / n as f64);
    let damping = |k: usize| 6.9 / (0.2 + 1.8 * ((k * 7919) % 1000) as f64 / 1000.0);
    let all = 0..n;
    Modes::new("bank", all.clone().map(frequency).collect(), all.map(damping).collect(), vec![1.0; n])
        .expect("the modes are audible")
}

pub fn bench(item: Item) {
    let mut impulse = [0.0; BLOCK];
    impulse[0] = 1e-3;
    for (n, seconds) in [(64, 20), (1000, 4), (10_000, 1)] {
        let blocks = seconds * RATE as usize / BLOCK;
        for (name, form) in [("modes", BankForm::Time), ("frames-hop512", BankForm::Fourier)] {
            let mut bank =
                Bank::new(&modes(n), RATE, BankOutput::Displacement).expect("the modes are audible");
            bank.set_form(form, 5);
            let mut out = [0.0; BLOCK];
            let mut power = 0.0;
            item.rate(&format!("{name}.{n}"), (n * blocks * BLOCK) as f64, "mode-samples/s", || {
                power = 0.0;
                for k in 0..blocks {
                    bank.process(if k % INTERVAL == 0 { &impulse } else { &[] }, &mut out);
                    power += out[0] * out[0];
                }
            });
            item.print(&format!("{name}.{n}.rms"), (power / blocks as f32).sqrt().into(), "rms");
        }
    }
}
