//! Impacts from a file, as a node.

use super::event::{Body, Impact};
use super::reader::{Defaults, read_impacts};
use crate::core::fault::{Fault, Reject};
use crate::core::files::MemoryFiles;
use crate::core::node::{Class, Node};
use crate::core::params::{AssetPath, Params, Text};
use crate::core::ports::Events;
use crate::core::random::Rng;
use crate::core::shape::{Build, Shape};
use crate::core::time::Tick;
use crate::{params, ports};

params! {
    /// Impacts from a file: CSV with a header, or one JSON object per line.
    ///
    /// Required columns, or keys, are `time_s` and at least one of `velocity` (m/s), `energy` (J) and `impulse` (N s); the others of
    /// these three follow from the mass. Optional are `mass` (kg), `restitution`, `hardness` (1 is steel on stone, 0.01 rubber),
    /// `duration` (s), `object` (a number, or a name of `objects`), `point` (a number from 0), `position` (m; `x y z` with spaces
    /// in CSV, a list in JSON), `local` (the same in the frame of the object; by default `position`) and `comment`. Time may not decrease.
    pub struct ImpactFileParams {
        /// The file.
        path: AssetPath;
        /// Effective mass of the pair, if the file has none: `1 / (1/m1 + 1/m2)`.
        mass: f64 = 0.1, unit "kg", range 0.000001..=1_000_000.0;
        /// Speed after an impact over speed before, if the file has none.
        restitution: f64 = 0.5, unit "", range 0.0..=1.0;
        /// Stiffness of the pair, if the file has none.
        hardness: f64 = 1.0, unit "", range 0.000001..=1000.0;
        /// Names of the objects, from object 0.
        objects: Vec<Text> = Vec::new();
    }
}
ports! {
    pub struct ImpactFilePorts / ImpactFileIo {
        in {}
        out {
            /// The impacts.
            impacts: Events<Impact>,
        }
    }
}

/// The node `ImpactFile`.
#[derive(Debug)]
pub struct ImpactFile {
    impacts: Vec<(Tick, Impact)>,
}

fn read(p: &ImpactFileParams, bytes: &[u8]) -> Result<Vec<(Tick, Impact)>, Reject> {
    let defaults = Defaults {
        body: Body { mass: p.mass, restitution: p.restitution },
        hardness: p.hardness,
        objects: p.objects.iter().map(|name| name.0.clone()).collect(),
    };
    read_impacts(bytes, &defaults).map_err(|e| Reject::new("F079", format!("{:?}, {e}", p.path.0)).at("path"))
}

impl Node for ImpactFile {
    type Params = ImpactFileParams;
    type Ports = ImpactFilePorts;
    const NAME: &'static str = "ImpactFile";
    const CLASS: Class = Class::Audio;

    fn shape(p: &ImpactFileParams, s: &mut Shape<'_, '_, ImpactFilePorts>) -> Result<(), Reject> {
        let impacts = read(p, &s.bytes("path", &p.path.0)?)?;
        if impacts.is_empty() {
            s.note(format!("{:?} holds no impact", p.path.0));
        }
        s.ends(Some(impacts.last().map_or(0, |(tick, _)| tick + 1)));
        Ok(())
    }

    fn build(p: &ImpactFileParams, cx: &Build<'_>) -> Result<Self, Fault> {
        Ok(Self { impacts: read(p, &cx.bytes("path", &p.path.0)?)? })
    }

    fn run(&mut self, mut io: ImpactFileIo<'_>) -> Result<(), Fault> {
        let (from, to) = io.impacts.window();
        let first = self.impacts.partition_point(|(tick, _)| *tick < from);
        for (tick, impact) in self.impacts.iter().skip(first).take_while(|(tick, _)| *tick < to) {
            io.impacts.push(*tick, *impact);
        }
        Ok(())
    }

    fn trial(rng: &mut Rng) -> (ImpactFileParams, MemoryFiles) {
        let mut files = MemoryFiles::default();
        let mut text = String::from("time_s,velocity,object\n");
        let mut time = 0.0;
        for _ in 0..rng.below(20) {
            time += rng.between(0.0, 0.05);
            text += &format!("{time},{},{}\n", rng.between(-3.0, 3.0), ["bell", "7"][rng.below(2)]);
        }
        files.insert("impacts.csv", text);
        let params = ImpactFileParams {
            path: "impacts.csv".into(),
            objects: vec!["bell".into()],
            ..ImpactFileParams::trial(rng)
        };
        (params, files)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::params::Datum;
    use crate::core::standalone::Standalone;
    use crate::core::time::ticks;

    fn standalone(text: &str) -> Standalone {
        let path = Datum::Text("hits.csv".into());
        let p = ImpactFileParams::read(&|name| (name == "path").then(|| path.clone())).unwrap();
        let mut standalone = Standalone::new::<ImpactFile>(p);
        standalone.files.insert("hits.csv", text);
        standalone
    }

    #[test]
    fn impacts_have_their_times_with_any_window() {
        let standalone = standalone("time_s,velocity\n0,1\n0.1,2\n0.1,3\n0.25,4\n").window(ticks(0.03));
        let impacts = standalone.run().unwrap().events(ImpactFilePorts::impacts);
        let times: Vec<Tick> = impacts.iter().map(|(tick, _)| *tick).collect();
        assert_eq!(times, [0.0, 0.1, 0.1, 0.25].map(ticks));
        assert!((impacts[2].1.energy - 0.45).abs() < 1e-6, "0.1 kg at 3 m/s");
    }

    #[test]
    fn a_file_without_impacts_is_noted() {
        assert_eq!(standalone("time_s,velocity\n").shape().unwrap().notes, [r#""hits.csv" holds no impact"#]);
    }

    #[test]
    fn a_wrong_line_is_named_before_the_run() {
        let reject = standalone("time_s,velocity\n0,1\n0.1,fast\n").shape().unwrap_err();
        assert!(reject.code == "F079" && reject.message.contains("line 3"), "{reject}");
    }
}
