//! Modes from JSON or CSV, as a function and as a value node.

use super::modes::{MODES_VERSION, Modes};
use crate::artefact::value_file::Artefact;
use crate::artefact_file;
use crate::core::node::Summary;

/// Reads modes from JSON, as a tap of modes writes it, or from CSV.
///
/// Columns of a CSV are `frequency_hz`, `damping` (1/s), `gain`, `gain_1`, `gain_2`, ... for further contact points, and optionally
/// `phase` (radians).
///
/// # Errors
/// A message with the value found, its line in a CSV, and what is needed.
///
/// # Example
/// ```
/// let modes = foley_nodes::modal::read_modes(b"frequency_hz,damping,gain\n440,3,1\n1210,5,0.5\n")?;
/// assert_eq!(modes.frequencies, [440.0, 1210.0]);
/// # Ok::<(), String>(())
/// ```
pub fn read_modes(bytes: &[u8]) -> Result<Modes, String> {
    let bytes = crate::core::files::strip_bom(bytes);
    let json = bytes.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{');
    let modes = if json {
        serde_json::from_slice(bytes).map_err(|e| format!("these are not modes: {e}"))?
    } else {
        from_csv(bytes)?
    };
    modes.validate().map_err(|e| e.to_string())?;
    Ok(modes)
}

fn from_csv(bytes: &[u8]) -> Result<Modes, String> {
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let header: Vec<String> = csv.headers().map_err(|e| e.to_string())?.iter().map(str::to_owned).collect();
    let index = |name: &str| header.iter().position(|column| column == name);
    let need = |name: &str| {
        index(name)
            .ok_or_else(|| format!("no column `{name}`; columns are frequency_hz, damping, gain, phase"))
    };
    let (frequency, damping, phase) = (need("frequency_hz")?, need("damping")?, index("phase"));
    let mut gains = vec![need("gain")?];
    gains.extend((1..).map_while(|k| index(&format!("gain_{k}"))));
    let used = 2 + gains.len() + usize::from(phase.is_some());
    if used != header.len() {
        let text: String = header.join(", ").chars().take(120).collect();
        return Err(format!(
            "columns are {text}; they may be frequency_hz, damping, gain, gain_1, gain_2, ..., phase"
        ));
    }
    let mut rows = vec![Vec::new(); header.len()];
    for record in csv.records() {
        let record = record.map_err(|e| e.to_string())?;
        let line = record.position().map_or(0, csv::Position::line);
        for ((column, text), name) in rows.iter_mut().zip(&record).zip(&header) {
            let value = text.parse::<f64>().ok().filter(|x| x.is_finite());
            let text: String = text.chars().take(40).collect();
            column
                .push(value.ok_or_else(|| {
                    format!("line {line}: `{name}` is {text:?}; a finite number is needed")
                })?);
        }
    }
    let single = |k: usize| rows[k].iter().map(|x| *x as f32);
    Ok(Modes {
        version: MODES_VERSION,
        name: String::new(),
        frequencies: rows[frequency].clone(),
        dampings: rows[damping].clone(),
        gains: gains.iter().flat_map(|k| single(*k)).collect(),
        phases: phase.map(|k| single(k).collect()).unwrap_or_default(),
        noise: Vec::new(),
    })
}

impl Artefact for Modes {
    const CODE: &'static str = "F078";

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        read_modes(bytes)
    }

    fn summary(&self) -> Summary {
        Modes::summary(self)
    }
}

artefact_file! {
    /// Modes of an object from a file.
    ///
    /// The file is JSON as a tap of modes writes it, or CSV. Columns of a CSV are `frequency_hz`, `damping` (decay rate of the
    /// amplitude in 1/s), `gain` (full scale per N s), `gain_1`, `gain_2` and so on for further contact points, and optionally
    /// `phase` (radians).
    pub struct ModesFile / ModesFileParams / ModesFilePorts / ModesFileIo, version 2;
    /// The file.
    path: "modes.json";
    /// The modes.
    modes: Modes;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::random::Rng;
    use crate::core::standalone::Standalone;

    #[test]
    fn a_tap_is_read_again_and_csv_gives_the_same_modes() {
        let csv = "frequency_hz,damping,gain,gain_1,phase\n# low\n100,2.5,1,0.5,0\n250.5,9,-0.25,0,1.5\n";
        let modes = read_modes(csv.as_bytes()).unwrap();
        assert_eq!((modes.points(), modes.row(1)), (2, &[0.5, 0.0][..]));
        let mut standalone = Standalone::func::<ModesFile>(ModesFileParams { path: "m".into() });
        standalone.files.insert("m", serde_json::to_string(&modes).unwrap());
        assert_eq!(standalone.run().unwrap().value(0).unwrap().get::<Modes>(), Some(&modes));
    }

    #[test]
    fn errors_name_what_would_be_right() {
        for (text, part) in [
            ("frequency_hz,gain\n1,1\n", "no column `damping`"),
            ("frequency_hz,damping,gain,colour\n1,1,1,1\n", "they may be"),
            ("frequency_hz,damping,gain,gain_2\n1,1,1,1\n", "they may be"),
            ("frequency_hz,damping,gain\n1,1,1\n1,x,1\n", "line 3: `damping` is \"x\""),
            ("frequency_hz,damping,gain\n1,1,1\n1,1\n", "line: 3"),
            ("frequency_hz,damping,gain\n1,0,1\n", "`dampings` of mode 0 is 0"),
            ("frequency_hz,damping,gain\n", "0 modes"),
            ("{\"version\": 1, \"frequencies\": [1]}", "missing field `dampings`"),
            (
                "{\"version\": 1, \"frequencies\": [1], \"dampings\": [1], \"gains\": [1], \"size\": 2}",
                "unknown field",
            ),
            ("", "no column"),
        ] {
            let e = read_modes(text.as_bytes()).unwrap_err();
            assert!(e.contains(part), "{text:?}: {e}");
        }
        let mut standalone = Standalone::func::<ModesFile>(ModesFileParams { path: "m".into() });
        standalone.files.insert("m", "frequency_hz,damping,gain\n1,1,a\n");
        assert_eq!(standalone.shape().unwrap_err().code, "F078");
    }

    #[test]
    fn damaged_files_give_modes_or_an_error() {
        let csv = "frequency_hz,damping,gain,phase\n100,2.5,1,0\n250.5,9,-0.25,1.5\n";
        let json = serde_json::to_string(&read_modes(csv.as_bytes()).unwrap()).unwrap();
        let mut rng = Rng::new(5);
        let mut read = 0;
        for k in 0..4000 {
            let mut bytes = [csv, &json][k % 2].as_bytes().to_vec();
            for _ in 0..=rng.below(3) {
                let at = rng.below(bytes.len());
                match rng.below(3) {
                    0 => bytes[at] = b",\n\"-9e{}[]\xff\x00"[rng.below(12)],
                    1 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, b"0123456789.,-\n"[rng.below(14)]),
                }
            }
            if let Ok(modes) = read_modes(&bytes) {
                read += 1;
                assert!(modes.validate().is_ok());
            }
        }
        assert!(read > 200, "{read}");
    }
}
