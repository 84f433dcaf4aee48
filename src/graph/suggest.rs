//! "Did you mean": the nearest of the names that exist.

/// The name nearest to the written one, if it is near enough to be the intended one.
///
/// # Complexity
/// O(names * length^2).
#[must_use]
pub fn nearest<'a>(found: &str, names: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = found.to_lowercase();
    let near = |name: &str| distance(&lower, &name.to_lowercase());
    let best = names.into_iter().map(|name| (near(name), name)).min()?;
    let room = (found.chars().count() / 3).max(1);
    // A name of one letter has no near names.
    (best.0 <= room && best.0 < found.chars().count()).then_some(best.1)
}

/// `did you mean ...?` with the existing names, or only these names.
#[must_use]
pub fn help<'a>(found: &str, what: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    let shown: Vec<&str> = names.iter().copied().take(24).collect();
    let more = if names.len() > shown.len() {
        format!(", and {} more", names.len() - shown.len())
    } else {
        String::new()
    };
    let list = if names.is_empty() {
        format!("there are no {what}")
    } else {
        format!("{what}: {}{more}", shown.join(", "))
    };
    match nearest(found, names) {
        Some(name) => format!("did you mean `{name}`? {list}"),
        None => list,
    }
}

/// Message and help about a node type of a feature that this build does not have.
#[must_use]
pub fn omitted(name: &str, feature: &str) -> [String; 2] {
    let message =
        format!("the node type `{name}` needs the feature `{feature}`, which this build does not have");
    let help = format!(
        "`cargo build --release` builds all features; after `--no-default-features` add `--features {feature}`"
    );
    [message, help]
}

/// Edits (insert, delete, replace, swap of neighbours) between two words.
fn distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    if a.len().abs_diff(b.len()) > 8 || a.len() > 64 {
        return usize::MAX;
    }
    let mut before: Vec<usize> = Vec::new();
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 1..=a.len() {
        let mut row = vec![i; b.len() + 1];
        for j in 1..=b.len() {
            let replace = last[j - 1] + usize::from(a[i - 1] != b[j - 1]);
            row[j] = replace.min(last[j] + 1).min(row[j - 1] + 1);
            if i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1] {
                row[j] = row[j].min(before[j - 2] + 1);
            }
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_finds_the_word_that_was_meant() {
        let names = ["ContactDetector", "SlidingSpeed", "IftNoise", "WavOut"];
        assert_eq!(nearest("ContactDetecter", names), Some("ContactDetector"));
        assert_eq!(nearest("wavout", names), Some("WavOut"));
        assert_eq!(nearest("IfTnosie", names), Some("IftNoise"));
        assert_eq!(nearest("Reverb", names), None);
    }

    #[test]
    fn a_node_type_that_a_build_omits_names_its_feature() {
        let [message, help] = omitted("GrainCluster", "grains");
        assert_eq!(
            message,
            "the node type `GrainCluster` needs the feature `grains`, which this build does not have"
        );
        assert!(help.ends_with("`--features grains`"), "{help}");
    }
}
