//! The node `PathProfile`.

use super::padded_map::{PaddedMap, check_grid};
use super::profile::{ContactProfile, PathProfile, append, picture};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Events, Fold, Many, Value};
use crate::core::shape::{Build, Shape};
use crate::scrape::path::piece::PathPiece;
use crate::texture::{DiscontinuityMap, FeatureMap, Grid, Luma, NoiseMap, Surface};
use crate::{archive_state, params, ports};

/// Maximum number of paths of one link in a figure.
const MAX_PATHS: usize = 24;

params! {
    /// Shows the paths of contacts over a map and the values of the map along each of them.
    ///
    /// Link one of `luma`, `map` (the size of its gradient), `features` and `noise`. Tap `profile` as .svg for the figure or as .json for
    /// its numbers. The figure shows the first 24 paths of each link.
    ///
    /// # Source
    /// Figure 6 of Picard, Tsingos and Faure, "Audio texture synthesis for complex contact interactions" (VRIPHYS 2008): three
    /// trajectories over a texture and their noise profiles, which look alike.
    pub struct PathProfileParams {
        /// Maximum number of values in a profile.
        most: usize = 4096, unit "values", range 2..=1_000_000_usize;
    }
}
ports! {
    pub struct PathProfilePorts / PathProfileIo {
        in {
            /// Paths over the map.
            paths: Many<Events<PathPiece>>,
            /// An image.
            luma: Option<Value<Luma>>,
            /// Its discontinuity map.
            map: Option<Value<DiscontinuityMap>>,
            /// Its features.
            features: Option<Value<FeatureMap>>,
            /// Its noise.
            noise: Option<Value<NoiseMap>>,
        }
        out {
            /// Paths and the values along them.
            profile: Fold<PathProfile>,
        }
    }
}

/// The node `PathProfile`.
#[derive(Debug)]
pub struct PathProfileNode {
    params: PathProfileParams,
    padded: PaddedMap<1>,
    surface: Surface,
    profile: PathProfile,
}

fn source(cx: &Build<'_>) -> Result<(&'static str, Grid, Surface), Reject> {
    type Port = PathProfilePorts;
    let mut all: Vec<(&'static str, Grid, Surface)> = Vec::new();
    if let Some(luma) = cx.optional_value(Port::luma) {
        all.push(("luma", luma.grid.clone(), luma.surface));
    }
    if let Some(map) = cx.optional_value(Port::map) {
        let samples = map.gx.samples.iter().zip(&map.gy.samples).map(|(x, y)| x.hypot(*y)).collect();
        all.push(("map", Grid { samples, ..map.gx }, map.surface));
    }
    if let Some(features) = cx.optional_value(Port::features) {
        all.push(("features", features.grid.clone(), features.surface));
    }
    if let Some(noise) = cx.optional_value(Port::noise) {
        all.push(("noise", noise.grid.clone(), noise.surface));
    }
    let count = all.len();
    all.pop().filter(|_| count == 1).ok_or_else(|| one_of(count))
}

fn one_of(count: usize) -> Reject {
    let message = format!("{count} of `luma`, `map`, `features` and `noise` are linked; one is needed");
    Reject::new("F128", message).at("luma")
}

impl Node for PathProfileNode {
    type Params = PathProfileParams;
    type Ports = PathProfilePorts;
    const NAME: &'static str = "PathProfile";
    const CLASS: Class = Class::Offline;

    fn shape(_: &PathProfileParams, s: &mut Shape<'_, '_, PathProfilePorts>) -> Result<(), Reject> {
        type Port = PathProfilePorts;
        let linked =
            [s.linked(Port::luma), s.linked(Port::map), s.linked(Port::features), s.linked(Port::noise)];
        let count = linked.iter().filter(|l| **l).count();
        if count == 1 { Ok(()) } else { Err(one_of(count)) }
    }

    fn build(p: &PathProfileParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let (name, grid, surface) = source(cx)?;
        check_grid(name, &grid, &surface)?;
        let [dx, dy] = surface.density;
        let profile = PathProfile {
            picture: picture(&grid),
            size: [grid.width as f64 / dx, grid.height as f64 / dy],
            contacts: Vec::new(),
        };
        let padded = PaddedMap::new([&grid], [[false; 2]], surface.wrap);
        Ok(Self { params: p.clone(), padded, surface, profile })
    }

    fn run(&mut self, io: PathProfileIo<'_>) -> Result<(), Fault> {
        let Self { params, padded, surface, profile } = self;
        for (link, paths) in io.paths.iter().enumerate() {
            for (_, piece) in paths.events() {
                let contacts = &mut profile.contacts;
                let known = contacts.iter().position(|m| (m.link, m.contact) == (link, piece.contact));
                let k = known.unwrap_or(contacts.len());
                if known.is_none() && contacts.iter().filter(|m| m.link == link).count() < MAX_PATHS {
                    contacts.push(ContactProfile {
                        link,
                        contact: piece.contact,
                        ..ContactProfile::default()
                    });
                }
                if let Some(met) = contacts.get_mut(k) {
                    append(met, piece, padded, surface, params.most);
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self, mut io: PathProfileIo<'_>) -> Result<Summary, Fault> {
        // Links are read one after the other within a window: the order of the figure is that of the links.
        self.profile.contacts.sort_by_key(|m| (m.link, m.contact));
        let contacts = self.profile.contacts.len();
        io.profile.set(std::mem::take(&mut self.profile));
        Ok(vec![("paths", contacts.into())])
    }

    archive_state!(profile);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::item::{AnyValue, Data};
    use crate::core::params::Params;
    use crate::core::standalone::{Feed, Standalone};
    use crate::core::time::ticks;
    use crate::scrape::testing::piece;

    #[test]
    fn a_profile_holds_the_values_along_its_path() {
        let map = FeatureMap {
            grid: Grid::from_fn(64, 64, |x, _| x as f32 / 64.0),
            surface: Surface { density: [64.0; 2], ..Surface::default() },
        };
        let params = PathProfileParams::read(&|_| None).unwrap();
        let pieces = vec![(0, piece([0.25, 0.5], [0.5, 0.0], 1.0))];
        let standalone = Standalone::new::<PathProfileNode>(params)
            .feed(PathProfilePorts::paths.index(), Feed::events(pieces, ticks(1.0)))
            .feed(PathProfilePorts::features.index(), Feed::value(AnyValue::new(map)));
        let run = standalone.run().unwrap();
        let profile = run.value(0).unwrap();
        let profile = profile.get::<PathProfile>().unwrap();
        let met = &profile.contacts[0];
        for (distance, value) in met.distance.iter().zip(&met.values) {
            assert!((value - 0.25 - distance).abs() < 1e-4, "{distance}: {value}");
        }
        assert_eq!(profile.picture.width, 64);
        let svg = profile.plot().unwrap();
        assert!(svg.contains("<polyline") && svg.contains("<path d=\"M") && svg.ends_with("</svg>\n"));
    }
}
