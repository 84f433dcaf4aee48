//! A calibration from the events of a take, as a node.

use super::calibration::{EnergyCalibration, EnergyMeter, Floor, calibration_summary};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Events, Fold};
use crate::core::shape::{Build, LinkShape, Shape};
use crate::core::time::seconds;
use crate::crumple::events::Crumple;
use crate::{archive_state, choices, params, ports};

choices! {
    /// Rule for the energy below which events are dropped.
    pub enum FloorRule {
        /// The energy `e_min`.
        Absolute,
        /// The percentile `percentile` of all events.
        Percentile,
        /// The energy above which there are `rate` events per second.
        Rate,
    }
}

params! {
    /// Measures the distribution of the energies of a take, and the energy below which events are dropped.
    ///
    /// `HistogramMatcher` ranks events by it. The minimum energy is a number, a percentile of all events, or follows
    /// from a number of events per second. The number is valid for one mesh and motion only. A tap writes the
    /// calibration as JSON for `EnergyCalibrationFile`.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), section 3 and
    /// table 1.
    pub struct EnergyCalibrationParams {
        /// Rule for the energy below which events are dropped.
        floor: FloorRule = FloorRule::Rate;
        /// Energy below which events are dropped, for `Absolute`.
        e_min: f64 = 0.0, unit "m^2", range 0.0..=1e12;
        /// Percentage of events that are dropped, for `Percentile`.
        percentile: f64 = 50.0, unit "%", range 0.0..=100.0;
        /// Events per second that are not dropped, for `Rate`.
        rate: f64 = 20.0, unit "1/s", range 0.001..=100_000.0;
    }
}
ports! {
    pub struct EnergyCalibrationPorts / EnergyCalibrationIo {
        in {
            /// Events of a whole take.
            events: Events<Crumple>,
        }
        out {
            /// The calibration.
            calibration: Fold<EnergyCalibration>,
        }
    }
}

/// The node `EnergyCalibration`.
pub struct EnergyCalibrationNode {
    meter: EnergyMeter,
    seconds: f64,
    floor: Floor,
}

/// Returns the end of the events in seconds, `None` if they do not end.
fn end(links: &[Vec<LinkShape>]) -> Option<f64> {
    match links.first()?.first()? {
        LinkShape::Events(end) => end.map(seconds),
        _ => None,
    }
}

impl Node for EnergyCalibrationNode {
    type Params = EnergyCalibrationParams;
    type Ports = EnergyCalibrationPorts;
    const NAME: &'static str = "EnergyCalibration";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Offline;

    fn shape(
        _: &EnergyCalibrationParams,
        _: &mut Shape<'_, '_, EnergyCalibrationPorts>,
    ) -> Result<(), Reject> {
        Ok(())
    }

    fn build(p: &EnergyCalibrationParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let Some(seconds) = end(cx.links) else {
            let message = "`events` does not end; a calibration needs a finite take";
            return Err(Fault::new("F075", message)
                .at("events")
                .help("use `adapt: true` on HistogramMatcher"));
        };
        let floor = match p.floor {
            FloorRule::Absolute => Floor::Absolute(p.e_min),
            FloorRule::Percentile => Floor::Percentile(p.percentile),
            FloorRule::Rate => Floor::Rate(p.rate),
        };
        Ok(Self { meter: EnergyMeter::default(), seconds, floor })
    }

    fn run(&mut self, io: EnergyCalibrationIo<'_>) -> Result<(), Fault> {
        for (tick, event) in io.events.events() {
            self.meter.add(event).map_err(|e| Fault::new("F106", e.to_string()).at("events").when(*tick))?;
        }
        Ok(())
    }

    fn finish(&mut self, mut io: EnergyCalibrationIo<'_>) -> Result<Summary, Fault> {
        let calibration = std::mem::take(&mut self.meter).finish(self.seconds, self.floor);
        let summary = calibration_summary(&calibration);
        io.calibration.set(calibration);
        Ok(summary)
    }

    archive_state!(meter);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::Event;
    use crate::core::random::Rng;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;
    use crate::crumple::Weight;
    use crate::crumple::matching::energy_calibration_file::{
        EnergyCalibrationFile, EnergyCalibrationFileParams,
    };

    fn events(weights: [Weight; 2]) -> Vec<(i64, Crumple)> {
        let mut rng = Rng::new(1);
        let event = |k: usize| Crumple {
            energy: k as f64,
            weight: weights[k / 50],
            interval: ticks(1.0 / 60.0),
            ..Crumple::trial(&mut rng)
        };
        (0..100).map(event).enumerate().map(|(k, e)| (ticks(0.05 * k as f64), e)).collect()
    }

    fn standalone(weights: [Weight; 2]) -> Standalone {
        let p = EnergyCalibrationParams { floor: FloorRule::Rate, e_min: 0.0, percentile: 0.0, rate: 4.0 };
        Standalone::new::<EnergyCalibrationNode>(p).events(
            EnergyCalibrationPorts::events,
            events(weights),
            ticks(5.0),
        )
    }

    #[test]
    fn a_calibration_does_not_depend_on_windows_and_is_read_back_from_its_file() {
        let of = |window: f64| {
            let run = standalone([Weight::Area; 2]).window(ticks(window)).run().unwrap();
            run.value(0).unwrap()
        };
        let value = of(9.0);
        let found = value.get::<EnergyCalibration>().unwrap();
        assert_eq!((found.e_min, found.events, found.seconds, found.fps), (80.0, 20, 5.0, 60.0));
        assert_eq!(of(0.013).get::<EnergyCalibration>(), Some(found));
        let json = value.json();
        let mut file =
            Standalone::func::<EnergyCalibrationFile>(EnergyCalibrationFileParams { path: "c".into() });
        file.files.insert("c", json.clone());
        assert_eq!(file.run().unwrap().value(0).unwrap().get::<EnergyCalibration>(), Some(found));
        file.files.insert("c", json.replace("\"fps\": 60", "\"fps\": 30"));
        let reject = file.shape().unwrap_err();
        assert!(reject.code == "F106" && reject.message.contains("conventions"), "{reject}");
        file.files.insert("c", json.replace("\"dropped\": 80", "\"dropped\": 81"));
        let reject = file.shape().unwrap_err();
        assert!(reject.code == "F106" && reject.message.contains("`content`"), "{reject} {json}");
    }

    #[test]
    fn energies_of_two_weights_are_refused() {
        let fault = standalone([Weight::Area, Weight::None]).run().err().unwrap();
        assert!(fault.code == "F106" && fault.message.contains("`weight`"), "{fault}");
    }
}
