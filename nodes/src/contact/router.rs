//! Contacts by what meets in them.

use super::{Contact, Contacts, ContactsFormat};
use crate::archive_state;
use crate::core::fault::Reject;
use crate::core::node::{Each, Summary};
use crate::core::params::Text;
use crate::core::random::Rng;
use crate::params;

params! {
    /// The contacts in which two given materials meet; vertices with other contacts are as if they touched nothing.
    ///
    /// One such node per pair gives each pair its own sliding speeds, and so its own friction model, level and, further on,
    /// units of recordings: a loud pair cannot mask another. Materials come with the meshes (`MeshSequence`, parameter
    /// `material`, and `usemtl` of an OBJ). Where a vertex lies between two materials, the one of the larger area counts.
    ///
    /// # Source
    /// An addition to An, James and Marschner (SIGGRAPH 2012), who have one material to a scene.
    pub struct MaterialRouterParams {
        /// The two materials, in any order; the same one twice for cloth on itself.
        between: [Text; 2];
    }
}

/// Lets the contacts of one pair of materials through.
#[derive(Debug)]
pub struct MaterialRouter {
    format: ContactsFormat,
    between: [String; 2],
    contacts: u64,
    kept: u64,
}

fn shown(name: &str) -> &str {
    if name.is_empty() { "(unnamed)" } else { name }
}

/// Why no contact can be between the two, if none can.
fn impossible(format: &ContactsFormat, between: &[Text; 2]) -> Option<Reject> {
    let cloth = format.surfaces.first().map_or(&[][..], |m| m.names());
    let all = || format.surfaces.iter().flat_map(|m| m.names());
    let meet = |a: &str, b: &str| cloth.iter().any(|n| n == a) && all().any(|n| n == b);
    let [a, b] = between.each_ref().map(|text| text.0.as_str());
    if meet(a, b) || meet(b, a) {
        return None;
    }
    let mut others: Vec<&str> = all().map(|n| shown(n)).collect();
    others.sort_unstable();
    others.dedup();
    let cloth: Vec<&str> = cloth.iter().map(|n| shown(n)).collect();
    let message = format!("{} and {} never meet", shown(a), shown(b));
    let help = format!("the cloth is of {}; it meets {}", cloth.join(", "), others.join(", "));
    Some(Reject::new("F107", message).at("between").help(help))
}

/// Whether two unordered pairs are the same.
fn same(a: [&str; 2], b: &[String; 2]) -> bool {
    (a[0] == b[0] && a[1] == b[1]) || (a[0] == b[1] && a[1] == b[0])
}

impl Each for MaterialRouter {
    type Params = MaterialRouterParams;
    type In = Contacts;
    type Out = Contacts;
    const NAME: &'static str = "MaterialRouter";
    const INPUT: (&'static str, &'static str) = ("contacts", "Contacts of a cloth with anything.");
    const OUTPUT: (&'static str, &'static str) = ("routed", "Those between the two materials.");

    fn format(p: &MaterialRouterParams, format: &ContactsFormat) -> Result<ContactsFormat, Reject> {
        impossible(format, &p.between).map_or_else(|| Ok(format.clone()), Err)
    }

    fn new(p: &MaterialRouterParams, format: &ContactsFormat) -> Self {
        let between = p.between.each_ref().map(|text| text.0.clone());
        Self { format: format.clone(), between, contacts: 0, kept: 0 }
    }

    fn each(&mut self, item: &[Contact], out: &mut [Contact]) {
        let slots = self.format.slots.max(1);
        for (vertex, (found, kept)) in item.chunks(slots).zip(out.chunks_mut(slots)).enumerate() {
            kept.fill(Contact::default());
            let mut free = kept.iter_mut();
            for contact in found.iter().filter(|c| c.is_some()) {
                self.contacts += 1;
                if same(self.format.pair(vertex, contact), &self.between)
                    && let Some(slot) = free.next()
                {
                    *slot = *contact;
                    self.kept += 1;
                }
            }
        }
    }

    fn summary(&self) -> Summary {
        vec![("contacts", self.contacts.into()), ("kept", self.kept.into())]
    }

    archive_state!(contacts, kept);

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

    fn touch(surface: u32, triangle: u32) -> Contact {
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
        let mut out = vec![touch(9, 9); item.len()];
        MaterialRouter::new(&p, &format).each(item, &mut out);
        out.iter().map(|c| if c.is_some() { 10 * c.surface + c.triangle } else { 99 }).collect()
    }

    #[test]
    fn each_pair_has_its_own_contacts_whatever_the_order_of_their_names() {
        let item = [touch(0, 1), touch(1, 0), touch(0, 0)];
        for (between, wanted) in [
            (["cotton", "silk"], [1, 99, 0]),
            (["silk", "cotton"], [1, 99, 0]),
            (["wood", "cotton"], [99, 10, 99]),
            (["cotton", "cotton"], [99, 99, 99]),
            (["silk", "stone"], [99, 99, 99]),
        ] {
            assert_eq!(routed(between, 1, &item), wanted, "{between:?}");
        }
    }

    #[test]
    fn what_is_left_of_several_contacts_moves_up() {
        let item =
            [touch(1, 0), touch(1, 1), touch(1, 1), touch(0, 0), Contact::default(), Contact::default()];
        assert_eq!(routed(["stone", "cotton"], 2, &item), [11, 99, 11, 99, 99, 99]);
    }

    #[test]
    fn materials_that_never_meet_are_refused_with_those_that_do() {
        for between in [["wood", "stone"], ["cotton", "wol"]] {
            let p = MaterialRouterParams { between: between.map(Into::into) };
            let reject = MaterialRouter::format(&p, &format(1)).unwrap_err();
            let help = reject.help.unwrap_or_default();
            assert!(reject.code == "F107" && help.contains("the cloth is of cotton, silk"), "{help}");
            assert!(help.contains("stone") && help.contains("wood"), "{help}");
        }
        let unnamed = ContactsFormat::plain(vec![1e-4].into(), 1);
        let p = MaterialRouterParams { between: ["a", "b"].map(Into::into) };
        assert!(MaterialRouter::format(&p, &unnamed).is_err());
    }
}
