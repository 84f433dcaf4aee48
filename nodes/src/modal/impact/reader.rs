//! Impacts from CSV or JSON lines.

use super::event::{Body, Impact};
use crate::core::files::excerpt;
use crate::core::time::{Tick, ticks};
use crate::io::csv_error;
use std::collections::BTreeMap;
use thiserror::Error;

/// Maximum number of impacts in a file.
pub const MAX_IMPACTS: usize = 1 << 20;
/// Latest time of an impact, in s.
const MAX_TIME: f64 = 86_400.0;

/// Columns (CSV) or keys (JSON) of a file.
pub const COLUMNS: [&str; 13] = [
    "time_s",
    "impulse",
    "energy",
    "velocity",
    "mass",
    "restitution",
    "hardness",
    "duration",
    "object",
    "point",
    "position",
    "local",
    "comment",
];

/// Error in a file of impacts.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("line {line}: {message}")]
pub struct ImpactError {
    /// Line of the file, from 1.
    pub line: u64,
    /// Description of the mistake, and of the correct form.
    pub message: String,
}

/// Values of columns that a file does not have.
#[derive(Clone, Debug, PartialEq)]
pub struct Defaults {
    /// The striking body.
    pub body: Body,
    /// Stiffness of the pair relative to steel on stone.
    pub hardness: f64,
    /// Names of the objects, by number; empty if a file has numbers only.
    pub objects: Vec<String>,
}

/// One line of a file: its fields by name.
type Fields = BTreeMap<&'static str, String>;

fn column(name: &str) -> Result<&'static str, String> {
    let found = COLUMNS.iter().find(|column| **column == name);
    found
        .copied()
        .ok_or_else(|| format!("there is no column {:?}; columns are {}", excerpt(name), COLUMNS.join(", ")))
}

fn number(fields: &Fields, name: &str, low: f64, high: f64) -> Result<Option<f64>, String> {
    let Some(text) = fields.get(name) else { return Ok(None) };
    let value = text.parse::<f64>().ok().filter(|x| (low..=high).contains(x));
    let wrong = || format!("`{name}` is {:?}; a number from {low} to {high} is needed", excerpt(text));
    value.map(Some).ok_or_else(wrong)
}

fn index(fields: &Fields, name: &str) -> Result<u32, String> {
    let Some(text) = fields.get(name) else { return Ok(0) };
    let wrong = || format!("`{name}` is {:?}; a whole number from 0 on is needed", excerpt(text));
    text.parse().map_err(|_| wrong())
}

fn object(fields: &Fields, names: &[String]) -> Result<u32, String> {
    let Some(text) = fields.get("object") else { return Ok(0) };
    if let Some(index) = names.iter().position(|name| name == text) {
        return Ok(index as u32);
    }
    text.parse().map_err(|_| {
        let names = if names.is_empty() { "none is named".into() } else { names.join(", ") };
        format!("there is no object {:?}; objects are numbers from 0 on, or names: {names}", excerpt(text))
    })
}

fn vector(fields: &Fields, name: &str) -> Result<Option<[f32; 3]>, String> {
    let Some(text) = fields.get(name) else { return Ok(None) };
    let wrong =
        || format!("`{name}` is {:?}; three numbers are needed, such as \"0.1 0 2.5\"", excerpt(text));
    let numbers: Vec<f32> =
        text.split_whitespace().map(str::parse).collect::<Result<_, _>>().map_err(|_| wrong())?;
    let vector: [f32; 3] = numbers.try_into().map_err(|_| wrong())?;
    if vector.iter().all(|x| x.is_finite()) { Ok(Some(vector)) } else { Err(wrong()) }
}

fn impact(fields: &Fields, defaults: &Defaults) -> Result<(f64, Impact), String> {
    const MAX: f64 = 1e9;
    let time = number(fields, "time_s", 0.0, MAX_TIME)?
        .ok_or("`time_s` is missing: the time of the impact, in seconds")?;
    let body = Body {
        mass: number(fields, "mass", 0.0, MAX)?.unwrap_or(defaults.body.mass),
        restitution: number(fields, "restitution", 0.0, 1.0)?.unwrap_or(defaults.body.restitution),
    };
    let velocity = number(fields, "velocity", -MAX, MAX)?;
    let energy = number(fields, "energy", 0.0, MAX)?;
    let impulse = number(fields, "impulse", 0.0, MAX)?;
    let mut impact = match (velocity, energy, impulse) {
        (Some(v), ..) => Impact::from_velocity(v, body),
        (None, Some(e), _) => Impact::from_energy(e, body),
        (None, None, Some(j)) => Impact::from_impulse(j, body),
        _ => {
            return Err(
                "its strength is missing: one of `impulse` (N s), `energy` (J) or `velocity` (m/s) is needed"
                    .into(),
            );
        }
    };
    // Given values replace those computed from the mass.
    impact.energy = energy.map_or(impact.energy, |e| e as f32);
    impact.impulse = impulse.map_or(impact.impulse, |j| j as f32);
    impact.hardness = number(fields, "hardness", 0.0, MAX)?.unwrap_or(defaults.hardness) as f32;
    impact.duration = number(fields, "duration", 0.0, 1.0)?.unwrap_or(0.0) as f32;
    impact.object = object(fields, &defaults.objects)?;
    impact.point = index(fields, "point")?;
    impact.position = vector(fields, "position")?.unwrap_or_default();
    // An object without a position of its own is at the origin of the world.
    impact.local = vector(fields, "local")?.unwrap_or(impact.position);
    if impact.is_valid() { Ok((time, impact)) } else { Err("its numbers are too large".into()) }
}

/// Collects impacts line by line.
struct Reader<'a> {
    defaults: &'a Defaults,
    impacts: Vec<(Tick, Impact)>,
    latest: f64,
}

impl Reader<'_> {
    fn take(&mut self, line: u64, fields: &Fields) -> Result<(), ImpactError> {
        let wrong = |message: String| ImpactError { line, message };
        let (time, impact) = impact(fields, self.defaults).map_err(wrong)?;
        if time < self.latest {
            return Err(wrong(format!(
                "time goes back from {} to {time} s; impacts must be in order of time",
                self.latest
            )));
        }
        if self.impacts.len() == MAX_IMPACTS {
            return Err(wrong(format!("at most {MAX_IMPACTS} impacts are read")));
        }
        self.latest = time;
        self.impacts.push((ticks(time), impact));
        Ok(())
    }
}

/// Reads impacts from CSV with a header of [`COLUMNS`], or from one JSON object with such keys per line.
///
/// `time_s` and one of `impulse`, `energy`, `velocity` are required. An empty cell is an error; a missing column has its
/// default. A position is `[x, y, z]` in JSON, and three numbers separated by spaces in CSV.
///
/// # Errors
/// An unknown column, a field that is no number or out of range, decreasing time, or a wrong number of fields. The error
/// names the line and what would be right.
///
/// # Example
/// ```
/// use foley_nodes::modal::{Body, Defaults, read_impacts};
///
/// let body = Body { mass: 0.05, restitution: 0.5 };
/// let defaults = Defaults { body, hardness: 0.5, objects: vec!["bell".into(), "box".into()] };
/// let impacts = read_impacts(b"time_s,velocity,object\n0.5,2,bell\n0.75,1,box\n", &defaults)?;
/// assert_eq!((impacts.len(), impacts[1].1.object), (2, 1));
/// # Ok::<(), foley_nodes::modal::ImpactError>(())
/// ```
pub fn read_impacts(bytes: &[u8], defaults: &Defaults) -> Result<Vec<(Tick, Impact)>, ImpactError> {
    let bytes = crate::core::files::strip_bom(bytes);
    let mut reader = Reader { defaults, impacts: Vec::new(), latest: 0.0 };
    match bytes.iter().find(|b| !b.is_ascii_whitespace()) {
        Some(b'{') => json_lines(bytes, &mut reader)?,
        Some(_) => csv_lines(bytes, &mut reader)?,
        None => return Err(ImpactError { line: 1, message: "the file is empty".into() }),
    }
    Ok(reader.impacts)
}

fn csv_lines(bytes: &[u8], reader: &mut Reader<'_>) -> Result<(), ImpactError> {
    let mut csv = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(bytes);
    let bad = |e: csv::Error| {
        let (line, message) = csv_error(&e);
        ImpactError { line, message }
    };
    let header = csv.headers().map_err(bad)?.clone();
    let line = header.position().map_or(1, csv::Position::line);
    let mut columns = Vec::new();
    for name in &header {
        let name = column(name).map_err(|message| ImpactError { line, message })?;
        if columns.contains(&name) {
            return Err(ImpactError { line, message: format!("there are two columns `{name}`") });
        }
        columns.push(name);
    }
    for record in csv.records() {
        let record = record.map_err(bad)?;
        let line = record.position().map_or(0, csv::Position::line);
        let mut fields = Fields::new();
        for (name, text) in columns.iter().zip(&record) {
            if text.is_empty() && *name != "comment" {
                let message = format!("`{name}` is empty; write a value, or leave the whole column out");
                return Err(ImpactError { line, message });
            }
            fields.insert(name, text.to_owned());
        }
        reader.take(line, &fields)?;
    }
    Ok(())
}

fn json_lines(bytes: &[u8], reader: &mut Reader<'_>) -> Result<(), ImpactError> {
    for (k, text) in bytes.split(|b| *b == b'\n').enumerate() {
        let line = k as u64 + 1;
        if text.trim_ascii().is_empty() {
            continue;
        }
        let wrong = |message: String| ImpactError { line, message };
        let object: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(text)
            .map_err(|e| wrong(format!("this is not a JSON object on one line: {e}")))?;
        let mut fields = Fields::new();
        for (name, value) in &object {
            let name = column(name).map_err(wrong)?;
            fields.insert(
                name,
                cell(value).ok_or_else(|| wrong(format!("`{name}` is neither number nor text")))?,
            );
        }
        reader.take(line, &fields)?;
    }
    Ok(())
}

/// The CSV cell of a JSON value.
fn cell(value: &serde_json::Value) -> Option<String> {
    match value {
        serde_json::Value::Number(x) => Some(x.to_string()),
        serde_json::Value::String(text) => Some(text.clone()),
        serde_json::Value::Array(list) => {
            let parts = list.iter().map(|x| x.as_f64().map(|x| x.to_string()));
            parts.collect::<Option<Vec<_>>>().map(|parts| parts.join(" "))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn defaults() -> Defaults {
        let objects = vec!["bell".to_owned(), "box".to_owned()];
        Defaults { body: Body { mass: 0.1, restitution: 0.5 }, hardness: 0.5, objects }
    }

    const CSV: &str = "time_s, energy, mass, hardness, object, point, position\n\
                       # a comment\n\
                       0.25, 0.2, 0.1, 0.9, box, 2, 0.5 0 -1\n\
                       0.25, 0.05, 0.2, 1e-2, 0, 0, 0 0 0\n";

    #[test]
    fn columns_become_impacts() {
        let impacts = read_impacts(CSV.as_bytes(), &defaults()).unwrap();
        let (tick, a) = impacts[0];
        assert_eq!((tick, a.object, a.point, a.position), (ticks(0.25), 1, 2, [0.5, 0.0, -1.0]));
        assert!((a.energy - 0.2).abs() < 1e-6 && (a.impulse - 0.1 * 2.0 * 1.5).abs() < 1e-6);
        assert_eq!((impacts[1].1.object, impacts[1].1.hardness), (0, 0.01));
    }

    #[test]
    fn json_lines_give_the_same_impacts() {
        let json = "{\"time_s\": 0.25, \"energy\": 0.2, \"hardness\": 0.9, \"object\": \"box\", \"point\": 2, \
                    \"position\": [0.5, 0, -1]}\n\n{\"time_s\": 1, \"impulse\": 0.3}\n";
        let impacts = read_impacts(json.as_bytes(), &defaults()).unwrap();
        assert_eq!(impacts[0], read_impacts(CSV.as_bytes(), &defaults()).unwrap()[0]);
        assert!((impacts[1].1.energy - 0.2).abs() < 1e-6 && impacts[1].1.hardness == 0.5);
        let with_bom = read_impacts(format!("\u{feff}{json}").as_bytes(), &defaults()).unwrap();
        assert_eq!(with_bom, impacts);
    }

    #[test]
    fn errors_name_the_line_and_what_would_be_right() {
        for (text, line, part) in [
            ("time_s,force\n0,1\n", 1, "no column \"force\"; columns are time_s, impulse"),
            ("time_s,energy,energy\n0,1,1\n", 1, "two columns `energy`"),
            ("time_s,energy\n0,1\n2,1\n1.5,1\n", 4, "time goes back from 2 to 1.5"),
            ("time_s,energy\n0,NaN\n", 2, "`energy` is \"NaN\"; a number from 0"),
            ("time_s,energy\n0,inf\n", 2, "`energy` is \"inf\""),
            ("time_s,energy\n-1,1\n", 2, "`time_s` is \"-1\"; a number from 0 to 86400"),
            ("time_s,energy\n0,\n", 2, "`energy` is empty"),
            ("time_s,energy\n0\n", 2, "1 field(s) where the header has 2"),
            ("energy\n0\n", 2, "`time_s` is missing"),
            ("time_s\n0\n", 2, "one of `impulse`"),
            (
                "time_s,energy,object\n0,1,gong\n",
                2,
                "no object \"gong\"; objects are numbers from 0 on, or names: bell, box",
            ),
            ("time_s,energy,point\n0,1,-1\n", 2, "`point` is \"-1\"; a whole number"),
            ("time_s,energy,position\n0,1,1 2\n", 2, "three numbers"),
            ("time_s,impulse,mass\n0,1e9,1e-40\n", 2, "too large"),
            ("{\"time_s\": 0, \"energy\": [}\n", 1, "not a JSON object"),
            ("{\"time_s\": 0, \"energy\": 1}\n{\"time_s\": 0, \"loud\": 1}\n", 2, "no column \"loud\""),
            ("{\"time_s\": null}", 1, "neither number nor text"),
            (" \n", 1, "empty"),
        ] {
            let e = read_impacts(text.as_bytes(), &defaults()).unwrap_err();
            assert!(e.line == line && e.message.contains(part), "{text:?}: {e}");
        }
    }

    #[test]
    fn damaged_files_give_impacts_or_an_error() {
        let json: &str = "{\"time_s\": 0.25, \"velocity\": -2, \"position\": [0.5, 0, -1]}\n{\"time_s\": 1, \"impulse\": 0.3}";
        let mut rng = crate::core::random::Rng::new(77);
        let (mut read, mut refused) = (0, 0);
        for k in 0..4000 {
            let mut bytes = [CSV, json][k % 2].as_bytes().to_vec();
            for _ in 0..=rng.below(3) {
                let at = rng.below(bytes.len());
                match rng.below(4) {
                    0 => bytes.truncate(at),
                    1 => bytes[at] = b",\n\"-9e{}#\xff\x00"[rng.below(11)],
                    2 => drop(bytes.remove(at)),
                    _ => bytes.insert(at, b"0123456789.,-\n"[rng.below(14)]),
                }
                if bytes.is_empty() {
                    break;
                }
            }
            match read_impacts(&bytes, &defaults()) {
                Ok(impacts) => {
                    read += 1;
                    assert!(impacts.iter().all(|(tick, impact)| *tick >= 0 && impact.is_valid()));
                    assert!(impacts.is_sorted_by_key(|(tick, _)| *tick));
                }
                Err(e) => {
                    refused += 1;
                    assert!(!e.message.is_empty() && e.line > 0, "{e}");
                }
            }
        }
        assert!(read > 100 && refused > 100, "{read} read, {refused} refused");
    }
}
