//! Status lines and the report of a graph that plays.

use super::level_curve::COLUMNS_PER_SECOND;
use super::session::Session;
use crate::cli::Exit;
use crate::cli::console::{print_line, print_styled};
use crate::cli::run::{show, write_whole};
use crate::diag::{Diagnostic, Sources};
use crate::live::Histogram;
use crate::live::device::Running;
use crate::live::input::{MeterReadings, Refusal};
use foley_nodes::core::time::seconds;
use foley_nodes::dsp::{Level, linear_to_db};
use serde_json::json;
use std::io::IsTerminal;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

/// Interval between two status lines.
const STATUS: Duration = Duration::from_secs(1);

fn us(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e7).round() / 10.0
}

fn times(histogram: &Histogram) -> serde_json::Value {
    json!({
        "calls": histogram.calls(),
        "median_us": us(histogram.quantile(0.5)),
        "p99_us": us(histogram.quantile(0.99)),
        "worst_us": us(histogram.worst()),
    })
}

fn levels(meter: &MeterReadings) -> serde_json::Value {
    let list = |value: fn(&Level) -> f64| meter.readings.iter().map(value).collect::<Vec<_>>();
    json!({ "name": meter.name, "rate": meter.rate, "peak": list(|l| l.peak.into()), "rms": list(|l| l.rms) })
}

impl Session<'_> {
    pub(super) fn status(&mut self) -> std::io::Result<()> {
        let terminal = std::io::stderr().is_terminal();
        let columns = Duration::from_secs_f64(1.0 / COLUMNS_PER_SECOND);
        let interval = if self.curves.is_empty() || self.settings.json { STATUS } else { columns };
        if self.shown.elapsed() < interval {
            return Ok(());
        }
        self.shown = Instant::now();
        if let Some(peaks) = self.player.take_levels() {
            self.levels.set_nodes(&peaks);
        }
        let shared = self.player.shared();
        let meter = &shared.meter;
        let budget = self.settings.device.quantum as f64 / self.player.plan().rate.as_f64();
        let played = shared.window.load(Relaxed) as f64 * budget;
        let peak = meter.take_peak();
        let readings = self.hub.meters.take();
        self.levels.add(peak, &readings, played);
        if self.settings.quiet || !(self.settings.json || terminal) {
            return Ok(());
        }
        if self.settings.json {
            let late = self.device.as_ref().map_or(0, |d| d.status.late.load(Relaxed));
            return print_line(
                &json!({
                    "played_s": played,
                    "callback": times(&meter.callback),
                    "missed": meter.missed.load(Relaxed),
                    "overruns": meter.overruns.load(Relaxed),
                    "late": late,
                    "peak": peak,
                    "meters": readings.iter().map(levels).collect::<Vec<_>>(),
                    "nodes": self.nodes(),
                })
                .to_string(),
            );
        }
        self.curves.add(&readings);
        let load = meter.callback.quantile(0.99).as_secs_f64() / budget * 100.0;
        let status = format!(
            "{played:8.1} s   load {load:5.1} %   worst {:7.0} us   missed {}   peak {:6.1} dB ",
            us(meter.callback.worst()),
            meter.missed.load(Relaxed),
            linear_to_db(f64::from(peak.max(1e-6)))
        );
        print_styled(&format!("\r{status}\x1b[K{}", self.curves.draw()));
        Ok(())
    }

    /// Numbers of messages that were delivered or refused.
    fn messages(&self) -> serde_json::Value {
        let mut all = serde_json::Map::new();
        all.insert("delivered".to_owned(), self.hub.delivered.load(Relaxed).into());
        let refused =
            Refusal::ALL.map(|refusal| (refusal.key().to_owned(), self.hub.refusals.count(refusal).into()));
        all.extend(refused);
        all.into()
    }

    /// The same in a line; `None` if there were none.
    fn message_line(&self) -> Option<String> {
        let refused = Refusal::ALL.map(|refusal| (self.hub.refusals.count(refusal), refusal.words()));
        let refused = refused.into_iter().filter(|(count, _)| *count > 0);
        let refused: Vec<String> = refused.map(|(count, words)| format!("{count} {words}")).collect();
        let delivered = self.hub.delivered.load(Relaxed);
        let list = if refused.is_empty() { String::new() } else { format!("; {}", refused.join(", ")) };
        (delivered > 0 || !refused.is_empty()).then(|| format!("messages: {delivered} delivered{list}"))
    }

    fn nodes(&self) -> Vec<serde_json::Value> {
        let one = |n: crate::live::NodeMeter| {
            json!({
                "id": n.id,
                "calls": n.calls,
                "median_us": us(n.median),
                "p99_us": us(n.p99),
                "worst_us": us(n.worst),
            })
        };
        self.player.node_meters().into_iter().map(one).collect()
    }

    pub(super) fn end(mut self, exit: Exit) -> anyhow::Result<Exit> {
        self.levels.end();
        let status = self.device.as_ref().map(|device| Arc::clone(&device.status)).unwrap_or_default();
        let stopped = self.device.take().map(Running::stop);
        let failure = stopped.and_then(Result::err).or_else(|| status.take_failure());
        if let Some(e) = failure {
            show(&[Diagnostic::general("F080", e)], &Sources::default());
            status.cut.store(true, Relaxed);
        }
        let exit = if status.cut.load(Relaxed) { Exit::Failed } else { exit };
        let shared = self.player.shared();
        let (meter, plan) = (&shared.meter, self.player.plan());
        let played =
            shared.window.load(Relaxed) as f64 * self.settings.device.quantum as f64 / plan.rate.as_f64();
        let mut notes: Vec<_> = self.noted.iter().collect();
        notes.sort();
        if let Some(path) = self.settings.report {
            let report = json!({
                "played_s": played,
                "rate": plan.rate.as_f64(),
                "quantum": self.settings.device.quantum,
                "channels": plan.channels,
                "latency_s": seconds(plan.latency),
                "callback": times(&meter.callback),
                "missed": meter.missed.load(Relaxed),
                "lost_events": meter.lost_events.load(Relaxed),
                "overruns": meter.overruns.load(Relaxed),
                "late": status.late.load(Relaxed),
                "lost_windows": status.lost_windows.load(Relaxed),
                "late_swaps": meter.late_swaps.load(Relaxed),
                "not_finite": meter.not_finite.load(Relaxed),
                "cut": meter.cut.load(Relaxed),
                "reload_ms": self.delays,
                "peak": meter.loudest(),
                "beyond_full_scale": meter.over.load(Relaxed),
                "messages": self.messages(),
                "notes": notes.iter().map(|(node, text)| json!({"node": node, "message": text})).collect::<Vec<_>>(),
                "nodes": self.nodes(),
            });
            write_whole(path, &format!("{report:#}\n"))?;
        }
        if !self.settings.quiet && !self.settings.json {
            print_line(&format!(
                "played {played:.2} s; callback median {:.0} us, worst {:.0} us; {} window(s) missed, {} overrun(s)",
                us(meter.callback.quantile(0.5)),
                us(meter.callback.worst()),
                meter.missed.load(Relaxed),
                meter.overruns.load(Relaxed)
            ))?;
            let (peak, over) = (meter.loudest(), meter.over.load(Relaxed));
            match over {
                _ if peak == 0.0 => print_line("the sound was silent")?,
                0 => print_line(&format!("peak {:.1} dB of full scale", linear_to_db(peak.into())))?,
                over => {
                    let advice = self.advice();
                    print_line(&format!("{over} sample(s) beyond full scale: {advice}"))?;
                }
            }
            if let Some(line) = self.message_line() {
                print_line(&line)?;
            }
        }
        Ok(exit)
    }
}
