//! Arguments of `foley live` and `foley watch`.

use super::graph::GraphArgs;
use super::parse::{parse_port, parse_quantum, parse_seconds};
use super::run::{MemoArgs, RunArgs};
use clap::Args as ClapArgs;
use std::path::PathBuf;

/// Arguments of `foley watch`.
#[derive(Clone, Debug, ClapArgs)]
pub struct WatchArgs {
    /// The run.
    #[command(flatten)]
    pub run: RunArgs,
    /// Look at the files this often, instead of waiting for events; for file systems that have none
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub poll: Option<f64>,
    /// Play the graph and go over to each save of it while it plays, instead of running it
    #[arg(long)]
    pub live: bool,
    /// The device; needs --live
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// The device, and the inputs.
#[derive(Clone, Debug, ClapArgs)]
pub struct DeviceArgs {
    /// `null` (a clock without sound), `file:PATH`, or the name of a sound card (in builds with the feature `live`)
    #[arg(long, value_name = "NAME")]
    pub device: Option<String>,
    /// Refuse to play at another rate than this
    #[arg(long, value_name = "HZ")]
    pub rate: Option<u32>,
    /// Frames per window
    #[arg(long, value_name = "N", allow_negative_numbers = true, default_value_t = 128, value_parser = parse_quantum)]
    pub quantum: usize,
    /// Lead of nodes outside of the audio callback
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, default_value_t = 0.08, value_parser = parse_seconds)]
    pub lead: f64,
    /// Listen for OSC at this port of this machine, or at ADDRESS:PORT; `off` for not at all
    #[arg(long, value_name = "PORT", default_value = "9000", value_parser = parse_port)]
    pub osc: String,
    /// Take frames of meshes over TCP at this port of this machine, or at ADDRESS:PORT; `off` for not at all
    #[arg(long, value_name = "PORT", default_value = "off", value_parser = parse_port)]
    pub meshes: String,
    /// Stop after this long
    #[arg(long = "for", value_name = "SECONDS", allow_negative_numbers = true, value_parser = parse_seconds)]
    pub duration: Option<f64>,
}

/// Arguments of `foley live`.
#[derive(Clone, Debug, ClapArgs)]
pub struct LiveArgs {
    /// The graph.
    #[command(flatten)]
    pub graph: GraphArgs,
    /// The device.
    #[command(flatten)]
    pub device: DeviceArgs,
    /// The cache.
    #[command(flatten)]
    pub memo: MemoArgs,
    /// Write times and counts as JSON at the end
    #[arg(long, value_name = "FILE.json")]
    pub report: Option<PathBuf>,
    /// Print the state as a line of JSON each second
    #[arg(long)]
    pub json: bool,
    /// Print errors only
    #[arg(long, short)]
    pub quiet: bool,
}
