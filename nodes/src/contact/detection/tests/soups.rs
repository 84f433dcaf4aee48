use proptest::prelude::*;

use crate::contact::broad_phase::bvh::Bvh;
use crate::contact::detection::reference::{Surfaces, contacts_of, excluded, key};
use crate::contact::vector::widen;
use crate::contact::{Contact, Detector, DetectorParams, Exclude};
use crate::mesh::Topology;

/// A small random generator for triangle soups.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }

    /// A coordinate in 0 .. 1; on a coarse lattice ties and degenerate triangles are common.
    fn coordinate(&mut self, coarse: bool) -> f32 {
        if coarse { self.below(5) as f32 / 4.0 } else { self.below(1 << 20) as f32 / (1 << 20) as f32 }
    }

    fn point(&mut self, coarse: bool) -> [f32; 3] {
        [(); 3].map(|()| self.coordinate(coarse))
    }

    fn soup(&mut self, vertices: u64, triangles: u64, coarse: bool) -> Topology {
        let rest = (0..vertices).map(|_| self.point(coarse)).collect();
        let triangles = (0..triangles).map(|_| [(); 3].map(|()| self.below(vertices) as u32)).collect();
        Topology { rest, triangles }
    }

    /// Positions near those of a scene, random or transformed.
    fn moved(&mut self, positions: &[[f32; 3]], coarse: bool) -> Vec<[f32; 3]> {
        match self.below(3) {
            0 => positions.iter().map(|_| self.point(coarse)).collect(),
            1 => positions.iter().map(|p| p.map(|x| x + 0.05 * self.coordinate(coarse))).collect(),
            _ => positions.iter().map(|p| [0.2 * p[2], 3.0 * p[0], p[1]]).collect(),
        }
    }
}

#[test]
fn the_search_equals_brute_force_on_1000_triangle_soups() {
    let mut total = 0;
    for seed in 0..1000 {
        let mut dice = Dice(seed);
        let coarse = seed % 4 == 0;
        let (vertices, triangles) = (3 + dice.below(40), dice.below(60));
        let cloth = dice.soup(vertices, triangles, coarse);
        let (vertices, triangles) = (3 + dice.below(60), dice.below(90));
        let other = dice.soup(vertices, triangles, coarse);
        let params = DetectorParams {
            radius: 0.02 + 0.3 * dice.coordinate(false),
            exclude: match dice.below(3) {
                0 => Exclude::Auto,
                1 => Exclude::Distance(dice.coordinate(coarse)),
                _ => Exclude::IncidentOnly,
            },
            max_contacts: 1 + dice.below(4) as usize,
            two_sided: dice.below(2) == 0,
            self_contact: dice.below(4) > 0,
            ..DetectorParams::default()
        };
        let own: Vec<_> =
            (0..cloth.vertex_count()).map(|v| excluded(&cloth, v, params.radius, params.exclude)).collect();
        let mut detector = Detector::new(&cloth, &[&other], params).unwrap();
        let mut out = vec![Contact::default(); cloth.vertex_count() * params.max_contacts];
        let (mut now, mut under) = (cloth.rest.clone(), other.rest.clone());
        for _ in 0..3 {
            detector.detect(&now, &[&under], &mut out).unwrap();
            let wide = |ps: &[[f32; 3]]| ps.iter().map(|&p| widen(p)).collect::<Vec<_>>();
            let positions: Surfaces = vec![wide(&now), wide(&under)];
            for (v, found) in out.chunks(params.max_contacts).enumerate() {
                let mut expected = contacts_of(v, &[&cloth, &other], &positions, &own[v], &params);
                expected.truncate(params.max_contacts);
                let found: Vec<_> =
                    found.iter().filter_map(|c| key(c).map(|k| (c.distance, k.0, k.1))).collect();
                let expected: Vec<_> = expected.iter().map(|e| (e.0.sqrt() as f32, e.1, e.2)).collect();
                assert_eq!(found, expected, "soup {seed}, vertex {v}, {params:?}");
                total += found.len();
            }
            (now, under) = (dice.moved(&now, coarse), dice.moved(&under, coarse));
        }
    }
    assert!(total > 10_000, "{total}");
}

#[test]
fn a_surface_that_crumples_is_sorted_again_and_finds_its_triangles() {
    let mut dice = Dice(7);
    let flat = super::grid(20, 0.05, 0.0);
    let mut bvh = Bvh::new(&flat.rest, &flat.triangles);
    assert!(bvh.update(&flat.rest), "the first frame settles the order");
    assert!(!bvh.update(&flat.rest));
    let crumpled: Vec<_> = flat.rest.iter().map(|_| dice.point(false)).collect();
    assert!(bvh.update(&crumpled));
    let soup = Topology { rest: crumpled.clone(), triangles: flat.triangles.clone() };
    let params = DetectorParams { radius: 0.3, self_contact: false, ..DetectorParams::default() };
    let nothing = Topology::default();
    for _ in 0..50 {
        let p = dice.point(false);
        let wide = crumpled.iter().map(|&p| widen(p)).collect();
        let expected = contacts_of(0, &[&nothing, &soup], &vec![vec![widen(p)], wide], &[], &params);
        let odd_triangles: Vec<_> = expected.iter().filter(|e| e.2 % 2 == 1).collect();
        let hit = bvh.closest(p, 0.3, |t| t % 2 == 1).map(|h| (h.squared_distance, 1, h.triangle));
        assert_eq!(hit, odd_triangles.first().copied().copied());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn relabelling_the_vertices_permutes_the_contacts(seed in any::<u64>()) {
        let mut dice = Dice(seed);
        let cloth = dice.soup(20, 15, false);
        let params = DetectorParams { radius: 0.3, exclude: Exclude::IncidentOnly, ..DetectorParams::default() };
        let reversed = Topology {
            rest: cloth.rest.iter().rev().copied().collect(),
            triangles: cloth.triangles.iter().map(|t| t.map(|v| 19 - v)).collect(),
        };
        let run = |mesh: &Topology| {
            let mut out = vec![Contact::default(); 20];
            Detector::new(mesh, &[], params).unwrap().detect(&mesh.rest, &[], &mut out).unwrap();
            out
        };
        let mut backwards = run(&reversed);
        backwards.reverse();
        prop_assert_eq!(run(&cloth), backwards);
    }
}
