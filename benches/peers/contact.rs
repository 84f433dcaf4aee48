//! Item 12: Contacts of a cloth of 10,000 vertices, ms per frame with the boxes refitted: the nearest point of a body for each vertex, and all
//! pairs of a vertex and a triangle of the cloth itself nearer than half an edge, without the incident ones.
//!
//! Two frames of the cloth take turns, as foley starts from the contacts of the frame before; `body.closest-point-only` asks the tree for one
//! point after the other without that. foley computes distances in double precision. It finds at most a number of pairs for each vertex, which
//! is above what occurs here. `self.nearest` is what its node does: the nearest triangle alone, outside of the neighbourhood of the vertex.

use super::data::{body, cloth};
use super::measure::Item;
use foley_nodes::contact::broad_phase::bvh::Bvh;
use foley_nodes::contact::{Contact, Detector, DetectorParams, Exclude};

const SIDE: usize = 100;
/// Motion of the folds from one frame to the next.
const STEP: f32 = 0.02;
/// A radius that contains all of the body, m.
const EVERYWHERE: f32 = 10.0;
/// Pairs of one vertex.
const SLOTS: usize = 16;

fn of_body(item: Item) {
    let (frames, body) = ([cloth(SIDE, 0.0), cloth(SIDE, STEP)], body(SIDE));
    let new = || Bvh::new(&body.rest, &body.triangles);
    item.time("body.build-bvh", 1e3, "ms", new);
    let mut tree = new();
    item.time("body.refit", 1e3, "ms", || tree.refit(&body.rest));
    item.time("body.closest-point-only", 1e3, "ms", || {
        frames[0].rest.iter().filter_map(|p| tree.closest(*p, EVERYWHERE, |_| true)).count()
    });
    let params = DetectorParams { radius: EVERYWHERE, self_contact: false, ..DetectorParams::default() };
    let mut detector = Detector::new(&frames[0], &[&body], params).expect("sound meshes");
    let mut out = vec![Contact::default(); frames[0].rest.len()];
    let mut k = 0;
    item.time("body.refit+closest-point", 1e3, "ms", || {
        k += 1;
        detector.detect(&frames[k % 2].rest, &[&body.rest], &mut out).expect("sound frames")
    });
    let mean = out.iter().map(|contact| f64::from(contact.distance)).sum::<f64>() / out.len() as f64;
    item.print("body.mean-distance", mean, "m");
}

fn of_itself(item: Item, metric: &str, count: &str, exclude: Exclude, max_contacts: usize) {
    let frames = [cloth(SIDE, 0.0), cloth(SIDE, STEP)];
    let radius = 0.5 / (SIDE - 1) as f32;
    let params = DetectorParams { radius, exclude, max_contacts, ..DetectorParams::default() };
    let mut detector = Detector::new(&frames[0], &[], params).expect("a sound mesh");
    let mut out = vec![Contact::default(); frames[0].rest.len() * max_contacts];
    let mut detect =
        |k: usize| detector.detect(&frames[k % 2].rest, &[], &mut out).expect("a sound frame").contacts;
    item.print(count, detect(0) as f64, "pairs");
    let mut k = 0;
    item.time(metric, 1e3, "ms", || {
        k += 1;
        detect(k)
    });
    // A vertex whose slots are all taken may have more pairs.
    if max_contacts > 1 {
        detect(0);
        let full = out.chunks(max_contacts).filter(|slots| slots.iter().all(Contact::is_some)).count();
        item.print(&format!("{count}.full-vertices"), full as f64, "vertices");
    }
}

pub fn bench(item: Item) {
    of_body(item);
    of_itself(item, "self.refit+vertex-triangle-pairs", "self.pairs", Exclude::IncidentOnly, SLOTS);
    of_itself(item, "self.nearest", "self.nearest.pairs", Exclude::Auto, 1);
}
