//! Logs of a physics engine, for tests.

use std::fs::read_to_string;
use std::path::Path;

/// Contacts and poses of a scene of the example graphs, at 60 frames per second.
pub(crate) fn shipped(scene: &str) -> [String; 2] {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/assets/contacts");
    ["contacts", "poses"].map(|name| read_to_string(folder.join(format!("{scene}.{name}.csv"))).unwrap())
}

/// A log without every other frame after a time in s, and with the impulses of the longer frames.
pub(crate) fn thinned(contacts: &str, from: f64) -> String {
    let mut lines = contacts.lines();
    let header = lines.next().unwrap();
    let impulses: Vec<bool> = header.split(',').map(|name| name.starts_with("impulse")).collect();
    let (mut text, mut last, mut count) = (format!("{header}\n"), "", 0);
    for line in lines {
        let (time, _) = line.split_once(',').unwrap();
        if time != last && time.parse::<f64>().unwrap() >= from {
            count += 1;
        }
        last = time;
        if count == 0 {
            text += line;
        } else if count % 2 == 0 {
            let doubled = |(field, impulse): (&str, &bool)| match field.parse::<f64>() {
                Ok(x) if *impulse => (2.0 * x).to_string(),
                _ => field.to_owned(),
            };
            text += &line.split(',').zip(&impulses).map(doubled).collect::<Vec<_>>().join(",");
        } else {
            continue;
        }
        text += "\n";
    }
    text
}
