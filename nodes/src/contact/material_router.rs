//! The node `MaterialRouter`.

use super::{Contact, Contacts, ContactsFormat};
use crate::archive_state;
use crate::core::fault::Reject;
use crate::core::node::{Each, Summary};
use crate::core::params::Text;
use crate::core::random::Rng;
use crate::params;

params! {
    /// Selects the contacts between two materials; other contacts are removed.
    ///
    /// One such node per pair provides each pair with its own sliding speeds, and so its own friction model, level and
    /// units of recordings: a loud pair cannot mask another. Materials come from the meshes (`MeshSequence`, parameter
    /// `material`, and `usemtl` of an OBJ). The material of a vertex between two materials is that of the larger area.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012), who have one material per scene.
    pub struct MaterialRouterParams {
        /// The two materials, in any order; the same one twice for cloth against itself.
        between: [Text; 2];
    }
}

/// Selects the contacts of one pair of materials.
#[derive(Debug)]
pub struct MaterialRouter {
    format: ContactsFormat,
    between: [String; 2],
    contacts: u64,
    selected: u64,
}

fn display_name(name: &str) -> &str {
    if name.is_empty() { "(unnamed)" } else { name }
}

/// Rejects two materials between which no contact is possible.
fn check_pair(format: &ContactsFormat, between: &[Text; 2]) -> Result<(), Reject> {
    let cloth = format.surfaces.first().map_or(&[][..], |m| m.names());
    let all = || format.surfaces.iter().flat_map(|m| m.names());
    let can_touch = |a: &str, b: &str| cloth.iter().any(|n| n == a) && all().any(|n| n == b);
    let [a, b] = between.each_ref().map(|text| text.0.as_str());
    if can_touch(a, b) || can_touch(b, a) {
        return Ok(());
    }
    let mut others: Vec<&str> = all().map(|n| display_name(n)).collect();
    others.sort_unstable();
    others.dedup();
    let cloth: Vec<&str> = cloth.iter().map(|n| display_name(n)).collect();
    let message = format!("{} and {} never touch", display_name(a), display_name(b));
    let help = format!("the cloth consists of {}; it touches {}", cloth.join(", "), others.join(", "));
    Err(Reject::new("F107", message).at("between").help(help))
}

/// Returns true if two unordered pairs are the same.
fn is_same_pair(a: [&str; 2], b: &[String; 2]) -> bool {
    (a[0] == b[0] && a[1] == b[1]) || (a[0] == b[1] && a[1] == b[0])
}

impl Each for MaterialRouter {
    type Params = MaterialRouterParams;
    type In = Contacts;
    type Out = Contacts;
    const NAME: &'static str = "MaterialRouter";
    const INPUT: (&'static str, &'static str) = ("contacts", "Contacts of a cloth.");
    const OUTPUT: (&'static str, &'static str) = ("routed", "Contacts between the two materials.");

    fn format(p: &MaterialRouterParams, format: &ContactsFormat) -> Result<ContactsFormat, Reject> {
        check_pair(format, &p.between).map(|()| format.clone())
    }

    fn new(p: &MaterialRouterParams, format: &ContactsFormat) -> Self {
        let between = p.between.each_ref().map(|text| text.0.clone());
        Self { format: format.clone(), between, contacts: 0, selected: 0 }
    }

    fn each(&mut self, item: &[Contact], out: &mut [Contact]) {
        let slots = self.format.slots.max(1);
        for (vertex, (found, selected)) in item.chunks(slots).zip(out.chunks_mut(slots)).enumerate() {
            selected.fill(Contact::default());
            let mut free = selected.iter_mut();
            for contact in found.iter().filter(|c| c.is_some()) {
                self.contacts += 1;
                if is_same_pair(self.format.pair(vertex, contact), &self.between)
                    && let Some(slot) = free.next()
                {
                    *slot = *contact;
                    self.selected += 1;
                }
            }
        }
    }

    fn summary(&self) -> Summary {
        vec![("contacts", self.contacts.into()), ("selected", self.selected.into())]
    }

    archive_state!(contacts, selected);

    fn trial(rng: &mut Rng) -> MaterialRouterParams {
        let other = ["cotton", "wool"][rng.below(2)];
        MaterialRouterParams { between: ["cotton".into(), other.into()] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Materials;
    use std::sync::Arc;

    fn contact(surface: u32, triangle: u32) -> Contact {
        Contact { surface, triangle, ..Contact::default() }
    }

    /// Three vertices of cotton, cotton and silk, which can touch their own cloth and a body of wood and stone.
    fn format(slots: usize) -> ContactsFormat {
        let (mut cloth, mut body) = (Materials::default(), Materials::default());
        ["cotton", "silk"].iter().for_each(|name| cloth.push(name));
        ["wood", "stone"].iter().for_each(|name| body.push(name));
        let plain = ContactsFormat::plain(vec![1e-4; 3].into(), slots);
        ContactsFormat {
            cloth: vec![0, 0, 1].into(),
            surfaces: Arc::from([Arc::new(cloth), Arc::new(body)]),
            ..plain
        }
    }

    fn routed(between: [&str; 2], slots: usize, item: &[Contact]) -> Vec<u32> {
        let p = MaterialRouterParams { between: between.map(Into::into) };
        let format = MaterialRouter::format(&p, &format(slots)).unwrap();
        let mut out = vec![contact(9, 9); item.len()];
        MaterialRouter::new(&p, &format).each(item, &mut out);
        out.iter().map(|c| if c.is_some() { 10 * c.surface + c.triangle } else { 99 }).collect()
    }

    #[test]
    fn each_pair_has_its_own_contacts_for_any_order_of_names() {
        let item = [contact(0, 1), contact(1, 0), contact(0, 0)];
        for (between, expected) in [
            (["cotton", "silk"], [1, 99, 0]),
            (["silk", "cotton"], [1, 99, 0]),
            (["wood", "cotton"], [99, 10, 99]),
            (["cotton", "cotton"], [99, 99, 99]),
            (["silk", "stone"], [99, 99, 99]),
        ] {
            assert_eq!(routed(between, 1, &item), expected, "{between:?}");
        }
    }

    #[test]
    fn the_selected_contacts_of_a_vertex_come_first() {
        let item = [
            contact(1, 0),
            contact(1, 1),
            contact(1, 1),
            contact(0, 0),
            Contact::default(),
            Contact::default(),
        ];
        assert_eq!(routed(["stone", "cotton"], 2, &item), [11, 99, 11, 99, 99, 99]);
    }

    #[test]
    fn materials_that_never_meet_are_rejected_with_a_list_of_those_that_do() {
        for between in [["wood", "stone"], ["cotton", "wol"]] {
            let p = MaterialRouterParams { between: between.map(Into::into) };
            let reject = MaterialRouter::format(&p, &format(1)).unwrap_err();
            let help = reject.help.unwrap_or_default();
            assert!(reject.code == "F107" && help.contains("the cloth consists of cotton, silk"), "{help}");
            assert!(help.contains("stone") && help.contains("wood"), "{help}");
        }
        let unnamed = ContactsFormat::plain(vec![1e-4].into(), 1);
        let p = MaterialRouterParams { between: ["a", "b"].map(Into::into) };
        assert!(MaterialRouter::format(&p, &unnamed).is_err());
    }
}
