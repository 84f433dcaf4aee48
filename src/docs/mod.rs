//! The pages of the book that come from the code: the reference of nodes, errors and the command.
//!
//! [`pages`] makes their texts; none of their content is written by hand.

mod guide;
mod nodes;
mod words;

pub use words::{param_words, plain, port_words};

use crate::diag::codes;
use clap::Command;
use foley_nodes::registry::Registry;
use guide::GUIDE;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// First line of a generated page.
const NOTE: &str = "<!-- Made from the code by `foley docs --write`. -->\n";

/// Generated pages: paths below `docs/src`, and texts. `root` holds `docs` and `graphs`.
///
/// # Errors
/// If the summary of the book or an example graph cannot be read.
pub fn pages(root: &Path, command: Command, registry: &Registry) -> io::Result<Vec<(String, String)>> {
    let examples = nodes::examples(root)?;
    let mut pages = vec![("reference/nodes.md".to_owned(), nodes::index(registry))];
    pages.extend(registry.families().into_iter().map(|family| {
        (format!("reference/nodes/{family}.md"), nodes::family_page(family, registry, &examples))
    }));
    pages.push(("reference/errors.md".to_owned(), errors()));
    pages.push(("reference/cli.md".to_owned(), cli(command)));
    let summary = std::fs::read_to_string(root.join("docs/src/SUMMARY.md"))?;
    pages.push(("SUMMARY.md".to_owned(), with_reference(&summary, &registry.families())));
    Ok(pages)
}

/// A page of the book by its name, such as `cloth`, `errors` or `nodes/scrape`; those of the reference come from the code.
#[must_use]
pub fn page(name: &str, command: Command, registry: &Registry) -> Option<String> {
    let name = name.trim_end_matches(".md").trim_start_matches("reference/");
    if let Some((_, text)) = GUIDE.iter().find(|(page, _)| *page == name) {
        return Some((*text).to_owned());
    }
    let families = registry.families();
    match name {
        "nodes" => Some(nodes::index(registry)),
        "errors" => Some(errors()),
        "cli" => Some(cli(command)),
        _ => {
            let family = families.into_iter().find(|family| name.strip_prefix("nodes/") == Some(family))?;
            Some(nodes::family_page(family, registry, &Default::default()))
        }
    }
}

/// Names and titles of all pages, in the order of the book.
#[must_use]
pub fn page_names(registry: &Registry) -> Vec<(String, String)> {
    let guide = GUIDE.iter().map(|(name, text)| ((*name).to_owned(), guide::title(text).to_owned()));
    let reference = [("nodes", "Nodes"), ("errors", "Errors"), ("cli", "The command")];
    let reference = reference.map(|(name, title)| (name.to_owned(), title.to_owned()));
    let families = registry.families().into_iter();
    let families = families.map(|family| (format!("nodes/{family}"), format!("Nodes: {family}")));
    guide.chain(reference).chain(families).collect()
}

fn errors() -> String {
    let mut out = format!(
        "{NOTE}# Errors\n\nEvery message has a code that stays the same between versions. `foley explain CODE` prints its \
         entry.\n\n| code | |\n|---|---|\n"
    );
    for code in codes::all() {
        let anchor = anchor(&format!("{}: {}", code.code, code.title));
        let _ = writeln!(out, "| [{}](#{anchor}) | {} |", code.code, code.title);
    }
    for code in codes::all() {
        let _ = writeln!(out, "\n## {}: {}\n\n{}", code.code, code.title, code.text);
    }
    out
}

/// The anchor that a book generates for a heading.
#[must_use]
pub fn anchor(heading: &str) -> String {
    let allowed = heading.chars().filter(|c| c.is_alphanumeric() || matches!(c, '-' | '_' | ' '));
    allowed.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

fn cli(command: Command) -> String {
    // A fixed width, so that the page does not depend on the terminal.
    let mut command = command.term_width(100);
    command.build();
    let mut out = format!(
        "{NOTE}# The command\n\nExit codes: 0 done, 1 the run failed, 2 the graph, an input or an argument is wrong, 75 stopped \
         (try again).\n"
    );
    let help = |command: &Command| {
        let text = command.clone().render_help().to_string();
        text.lines().map(str::trim_end).collect::<Vec<_>>().join("\n")
    };
    let subs = |command: &Command| -> Vec<Command> {
        command.get_subcommands().filter(|s| s.get_name() != "help").cloned().collect()
    };
    for sub in subs(&command) {
        let _ = write!(out, "\n## foley {}\n\n```text\n{}\n```\n", sub.get_name(), help(&sub));
        for part in subs(&sub) {
            let names = format!("{} {}", sub.get_name(), part.get_name());
            let _ = write!(out, "\n### foley {names}\n\n```text\n{}\n```\n", help(&part));
        }
    }
    out
}

/// The summary with a new part `# Reference`; the other parts are unchanged.
fn with_reference(summary: &str, families: &[&str]) -> String {
    let mut part = String::from("# Reference\n\n- [Nodes](reference/nodes.md)\n");
    for family in families {
        let _ = writeln!(part, "  - [{family}](reference/nodes/{family}.md)");
    }
    part.push_str("- [Errors](reference/errors.md)\n- [The command](reference/cli.md)\n");
    let Some(start) = summary.find("# Reference\n") else {
        return format!("{}\n\n{part}", summary.trim_end());
    };
    let rest = &summary[start..];
    match rest.find("\n# ") {
        Some(end) => format!("{}{part}{}", &summary[..start], &rest[end..]),
        None => format!("{}{part}", &summary[..start]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_keeps_what_is_written_by_hand() {
        let old = "# Summary\n\n# Guide\n\n- [One](one.md)\n\n# Reference\n\n- [Old](old.md)\n\n# More\n\n- [Two](two.md)\n";
        let new = with_reference(old, &["io", "dsp"]);
        assert!(new.starts_with("# Summary\n\n# Guide\n\n- [One](one.md)\n\n# Reference\n\n- [Nodes]"));
        assert!(new.ends_with("\n\n# More\n\n- [Two](two.md)\n") && !new.contains("old.md"));
        assert_eq!(with_reference(&new, &["io", "dsp"]), new);
        assert!(with_reference("# Summary\n", &[]).ends_with("(reference/cli.md)\n"));
    }

    #[test]
    fn anchors_are_those_of_a_book() {
        assert_eq!(anchor("F022: which of several outputs?"), "f022-which-of-several-outputs");
        assert_eq!(anchor("--set and params"), "--set-and-params");
    }
}
