//! Figures of events.

use super::columns::Moments;
use super::text::{Listing, figure};
use foley_nodes::core::time::{Tick, seconds};
use foley_nodes::plot::{Chart, Line};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;

/// Largest number of fields with figures.
const MAX_FIELDS: usize = 16;
/// Largest number of different texts of a field that are counted.
const MAX_TEXTS: usize = 8;
/// Fields that are drawn, and points of each.
const DRAWN: (usize, usize) = (4, 20_000);

/// Figures of events.
#[derive(Clone, Debug, Serialize)]
pub struct EventFigures {
    /// Name of the event type.
    pub event: &'static str,
    /// Number of events.
    pub count: usize,
    /// Events per second from the first to the last.
    pub per_second: Option<f64>,
    /// Time of the first one, s.
    pub first_at: Option<f64>,
    /// Time of the last one, s.
    pub last_at: Option<f64>,
    /// From one to the next, s; `None` for fewer than two.
    pub intervals: Option<Intervals>,
    /// Numeric fields.
    pub fields: Vec<FieldFigures>,
    /// Other fields: each text, and how often it occurs.
    pub texts: BTreeMap<String, BTreeMap<String, u64>>,
    /// The first events, each with its `time`.
    pub first: Vec<Value>,
}

/// Distribution of the times from one event to the next, s.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Intervals {
    /// The shortest.
    pub min: f64,
    /// A tenth is shorter.
    pub tenth: f64,
    /// Half are shorter.
    pub median: f64,
    /// Nine tenths are shorter.
    pub ninetieth: f64,
    /// The longest.
    pub max: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

/// Figures of a numeric field.
#[derive(Clone, Debug, Serialize)]
pub struct FieldFigures {
    /// Its name: `gain`, `point[0]`.
    pub name: String,
    /// Smallest number.
    pub min: f64,
    /// Largest number.
    pub max: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

/// Measures events.
#[derive(Debug)]
pub(super) struct EventProbe {
    event: &'static str,
    most: usize,
    times: Vec<Tick>,
    /// Numeric fields in the order of their first occurrence, with the first points of each.
    fields: Vec<(String, Moments, Vec<[f64; 2]>)>,
    texts: BTreeMap<String, BTreeMap<String, u64>>,
    first: Vec<(Tick, Value)>,
}

impl EventProbe {
    pub(super) fn new(event: &'static str, most: usize) -> Self {
        let (times, fields, texts, first) = Default::default();
        Self { event, most, times, fields, texts, first }
    }

    pub(super) fn push(&mut self, at: Tick, event: &Value) {
        self.times.push(at);
        if self.first.len() < self.most {
            self.first.push((at, event.clone()));
        }
        self.read("", at, event);
    }

    /// Adds the numbers and texts in a value.
    fn read(&mut self, name: &str, at: Tick, value: &Value) {
        match value {
            Value::Object(fields) => {
                for (key, value) in fields {
                    let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                    self.read(&name, at, value);
                }
            }
            Value::Array(values) => {
                for (k, value) in values.iter().enumerate().take(MAX_FIELDS) {
                    self.read(&format!("{name}[{k}]"), at, value);
                }
            }
            Value::Number(number) => self.number(name, at, number.as_f64().unwrap_or(f64::NAN)),
            Value::String(text) => self.text_of(name, text),
            Value::Bool(truth) => self.text_of(name, &truth.to_string()),
            Value::Null => {}
        }
    }

    fn number(&mut self, name: &str, at: Tick, x: f64) {
        let name = if name.is_empty() { "value" } else { name };
        let place = self.fields.iter().position(|(field, ..)| field == name);
        let place = place.unwrap_or_else(|| {
            self.fields.push((name.to_owned(), Moments::default(), Vec::new()));
            self.fields.len() - 1
        });
        // Further fields are counted nowhere.
        self.fields.truncate(MAX_FIELDS);
        if let Some((_, moments, points)) = self.fields.get_mut(place) {
            moments.push(x);
            if place < DRAWN.0 && points.len() < DRAWN.1 {
                points.push([seconds(at), x]);
            }
        }
    }

    fn text_of(&mut self, name: &str, text: &str) {
        let name = if name.is_empty() { "value" } else { name };
        let texts = self.texts.entry(name.to_owned()).or_default();
        let known = texts.contains_key(text) || texts.len() < MAX_TEXTS;
        *texts.entry(if known { text } else { "others" }.to_owned()).or_default() += 1;
    }

    pub(super) fn figures(&self) -> EventFigures {
        let span = self.times.first().zip(self.times.last()).map(|(a, b)| seconds(b - a));
        let per_second = span.filter(|span| *span > 0.0).map(|span| (self.times.len() - 1) as f64 / span);
        let field = |(name, moments, _): &(String, Moments, _)| FieldFigures {
            name: name.clone(),
            min: moments.min,
            max: moments.max,
            mean: moments.mean,
            deviation: moments.deviation(),
        };
        EventFigures {
            event: self.event,
            count: self.times.len(),
            per_second,
            first_at: self.times.first().map(|at| seconds(*at)),
            last_at: self.times.last().map(|at| seconds(*at)),
            intervals: intervals(&self.times),
            fields: self.fields.iter().map(field).collect(),
            texts: self.texts.clone(),
            first: self.first.iter().map(|(at, event)| timed(*at, event)).collect(),
        }
    }

    pub(super) fn draw(&self, title: &str) -> String {
        let lines = self.fields.iter().take(DRAWN.0);
        let mut lines: Vec<Line> =
            lines.map(|(name, _, points)| Line::dots(name.clone(), points.clone())).collect();
        if lines.is_empty() {
            let points = self.times.iter().take(DRAWN.1).map(|at| [seconds(*at), 1.0]);
            lines.push(Line::dots(self.event, points.collect()));
        }
        Chart::of(title, ("time, s", false), ("", false), lines).draw()
    }
}

/// An event with its time, s, as its first field.
fn timed(at: Tick, event: &Value) -> Value {
    let mut fields = serde_json::Map::from_iter([("time".to_owned(), seconds(at).into())]);
    match event {
        Value::Object(own) => fields.extend(own.clone()),
        other => fields.extend([("value".to_owned(), other.clone())]),
    }
    Value::Object(fields)
}

fn intervals(times: &[Tick]) -> Option<Intervals> {
    let mut all: Vec<f64> = times.windows(2).map(|pair| seconds(pair[1] - pair[0])).collect();
    let mut moments = Moments::default();
    all.iter().for_each(|x| moments.push(*x));
    all.sort_by(f64::total_cmp);
    let at = |share: f64| all.get((share * (all.len() - 1) as f64).round() as usize).copied();
    Some(Intervals {
        min: *all.first()?,
        tenth: at(0.1)?,
        median: at(0.5)?,
        ninetieth: at(0.9)?,
        max: *all.last()?,
        mean: moments.mean,
        deviation: moments.deviation(),
    })
}

impl EventFigures {
    /// Lines for people.
    #[must_use]
    pub fn text(&self, output: &str) -> String {
        let mut out = Listing::new(&format!("{output}: events of {}", self.event));
        let rate = self.per_second.map_or_else(String::new, |rate| format!(", {} per second", figure(rate)));
        out.line("count", format!("{}{rate}", self.count));
        if let (Some(first), Some(last)) = (self.first_at, self.last_at) {
            out.line("time", format!("from {first:.4} to {last:.4} s"));
        }
        if let Some(i) = &self.intervals {
            let [min, tenth, median, ninetieth, max, mean, deviation] =
                [i.min, i.tenth, i.median, i.ninetieth, i.max, i.mean, i.deviation].map(figure);
            out.line(
                "intervals",
                format!(
                    "{min} to {max} s, median {median}, 80 % from {tenth} to {ninetieth}; mean {mean}, deviation {deviation}"
                ),
            );
        }
        if !self.fields.is_empty() {
            let row = |f: &FieldFigures| {
                let [min, max, mean, deviation] = [f.min, f.max, f.mean, f.deviation].map(figure);
                vec![f.name.clone(), min, max, mean, deviation]
            };
            let rows: Vec<_> = self.fields.iter().map(row).collect();
            out.table(&["field", "min", "max", "mean", "deviation"], &rows);
        }
        for (name, texts) in &self.texts {
            let counts: Vec<String> = texts.iter().map(|(text, count)| format!("{text} {count}")).collect();
            out.line(name, counts.join(", "));
        }
        for event in &self.first {
            let time = event.get("time").and_then(Value::as_f64).unwrap_or(0.0);
            let mut rest = event.clone();
            if let Some(fields) = rest.as_object_mut() {
                fields.remove("time");
            }
            let text: String = rest.to_string().chars().take(200).collect();
            out.line(&format!("{time:.4} s"), text);
        }
        out.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use foley_nodes::core::time::ticks;
    use serde_json::json;

    #[test]
    fn events_have_counts_intervals_and_ranges_of_their_fields() {
        let mut probe = EventProbe::new("impact", 2);
        for (k, at) in [0.5, 1.0, 1.5, 3.5].into_iter().enumerate() {
            let kind = if k == 0 { "Soft" } else { "Hard" };
            probe.push(ticks(at), &json!({"gain": k, "point": [k as f64, 2.0], "kind": kind}));
        }
        let found = probe.figures();
        assert_eq!((found.count, found.per_second, found.first_at), (4, Some(1.0), Some(0.5)));
        let intervals = found.intervals.clone().unwrap();
        assert_eq!((intervals.min, intervals.median, intervals.max), (0.5, 0.5, 2.0));
        let names: Vec<&str> = found.fields.iter().map(|f| f.name.as_str()).collect();
        assert_eq!(names, ["gain", "point[0]", "point[1]"]);
        assert_eq!((found.fields[0].min, found.fields[0].max, found.fields[0].mean), (0.0, 3.0, 1.5));
        assert_eq!(found.texts["kind"]["Hard"], 3);
        assert_eq!((found.first.len(), found.first[1]["time"].as_f64()), (2, Some(1.0)));
        let text = found.text("a.b");
        assert!(text.contains("4, 1 per second") && text.contains("Hard 3, Soft 1"), "{text}");
        assert!(probe.draw("a.b").contains("point[0]"));
    }

    #[test]
    fn no_events_have_no_intervals() {
        let found = EventProbe::new("trigger", 2).figures();
        assert_eq!((found.count, found.intervals, found.per_second), (0, None, None));
    }
}
