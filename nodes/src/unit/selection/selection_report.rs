//! The report of a selection, as a node.

use super::picks::{Pick, PickFormat, Picks};
use super::report::{ChannelReport, REPORT_VERSION, SelectionReport, database_digest, report_summary};
use crate::core::fault::{Fault, Reject};
use crate::core::node::{Class, Node, Summary};
use crate::core::ports::{Fold, Stream, Value};
use crate::core::shape::{Build, Shape};
use crate::feature::Features;
use crate::unit::UnitDatabase;
use crate::{archive_state, params, ports};

params! {
    /// Reports a selection of units: tap it as JSON, or as a plot of the features against time.
    ///
    /// It counts fallbacks and lists the times with many of them. It also states the share of units skipped in silence, the lengths of
    /// runs, the repeats, and the share of the database that was used. Many fallbacks mean that the database lacks a sound, or that
    /// the warp maps features to the wrong region.
    ///
    /// # Source
    /// An, James and Marschner, "Motion-driven Concatenative Synthesis of Cloth Sounds" (SIGGRAPH 2012), figure 10, for the plot.
    pub struct SelectionReportParams {}
}

ports! {
    pub struct SelectionReportPorts / SelectionReportIo {
        in {
            /// The chosen units.
            picks: Stream<Picks>,
            /// The database that they are of.
            database: Value<UnitDatabase>,
            /// Features of the target, for the plot.
            features: Option<Stream<Features>>,
        }
        out {
            /// The report, once the target has ended.
            report: Fold<SelectionReport>,
        }
    }
}

/// Longest target, in units: four hours of milliseconds.
const MAX_UNITS: i64 = 14_400_000;

/// The node over [`ChannelReport`].
pub struct SelectionReportNode {
    picks: Vec<Vec<Pick>>,
    target: Vec<f32>,
    rate: f64,
    length: usize,
    dims: usize,
}

fn length(picks: Option<i64>) -> Result<usize, Reject> {
    match picks {
        Some(n) if n <= MAX_UNITS => Ok(n.max(0) as usize),
        found => {
            let found = found.map_or("does not end".into(), |n| format!("has {n} units"));
            let message = format!("`picks` {found}; a report is made of at most {MAX_UNITS}");
            Err(Reject::new("F075", message).at("picks").help("cut the target with Trim"))
        }
    }
}

impl Node for SelectionReportNode {
    type Params = SelectionReportParams;
    type Ports = SelectionReportPorts;
    const NAME: &'static str = "SelectionReport";
    const VERSION: u32 = 3;
    const CLASS: Class = Class::Offline;

    fn shape(_: &SelectionReportParams, s: &mut Shape<'_, '_, SelectionReportPorts>) -> Result<(), Reject> {
        let picks = s.input(SelectionReportPorts::picks);
        length(picks.items())?;
        if let Some(features) = s.optional(SelectionReportPorts::features) {
            s.check(crate::core::node::same_rate("features", features.rate, "`picks`", picks.rate));
        }
        s.ends(picks.end);
        Ok(())
    }

    fn build(_: &SelectionReportParams, cx: &Build<'_>) -> Result<Self, Fault> {
        let picks = cx.input(SelectionReportPorts::picks);
        let PickFormat { channels, conventions } = &picks.format;
        let db = cx.value(SelectionReportPorts::database);
        conventions.check("picks", &db.conventions, "database")?;
        db.validate().map_err(|e| Fault::new("F101", e.to_string()).at("database"))?;
        let length = length(picks.items())?;
        let dims = cx.optional(SelectionReportPorts::features).map_or(0, |f| f.format.dims());
        let target = Vec::with_capacity(length * dims);
        let picks_of = vec![Vec::with_capacity(length); *channels];
        Ok(Self { picks: picks_of, target, rate: picks.rate.as_f64(), length, dims })
    }

    fn run(&mut self, io: SelectionReportIo<'_>) -> Result<(), Fault> {
        let left = self.length.saturating_sub(self.picks.first().map_or(0, Vec::len));
        for item in io.picks.items().chunks_exact(io.picks.width().max(1)).take(left) {
            self.picks.iter_mut().zip(item).for_each(|(channel, pick)| channel.push(*pick));
        }
        if let Some(features) = &io.features {
            let items = features.items().chunks_exact(features.width().max(1));
            items.take(left).for_each(|item| self.target.extend(item.iter().take(self.dims)));
        }
        Ok(())
    }

    fn finish(&mut self, mut io: SelectionReportIo<'_>) -> Result<Summary, Fault> {
        let db = io.database;
        let dims = if self.dims == db.dims() { self.dims } else { 0 };
        let picks = std::mem::take(&mut self.picks);
        let channels: Vec<ChannelReport> =
            picks.into_iter().map(|picks| ChannelReport::new(picks, db, self.rate)).collect();
        let first = channels.first().map_or(&[][..], |channel| &channel.picks);
        let zero = vec![0.0; dims];
        let feature = |pick: &Pick| {
            let found = db.feature(pick.unit.max(0) as usize);
            if found.is_empty() { zero.clone() } else { found.to_vec() }
        };
        let chosen = if dims > 0 { first.iter().flat_map(feature).collect() } else { Vec::new() };
        let target = if dims > 0 { std::mem::take(&mut self.target) } else { Vec::new() };
        let summary = report_summary(&channels);
        io.report.set(SelectionReport {
            version: REPORT_VERSION,
            content: database_digest(db),
            rate: self.rate,
            units: db.len() as u64,
            channels,
            dims,
            target,
            chosen,
        });
        Ok(summary)
    }

    archive_state!(picks, target);
}
