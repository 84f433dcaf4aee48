//! Listeners for messages and meshes.

use super::LiveSettings;
use crate::cli::console::Throttle;
use crate::cli::run::show;
use crate::diag::{Diagnostic, Severity, Sources};
use crate::live::input::{Hub, Listener, listen_to_meshes, listen_to_osc, read_lines};
use std::io::IsTerminal;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;

/// Opens the listeners, each with its name.
pub(super) fn listen(
    settings: &LiveSettings<'_>,
    hub: &Arc<Hub>,
    errors: &Arc<Throttle>,
) -> Vec<(&'static str, Listener)> {
    let quiet = settings.quiet;
    if !std::io::stdin().is_terminal() {
        let (hub, errors) = (Arc::clone(hub), Arc::clone(errors));
        // It ends with the process: reading cannot be interrupted.
        std::thread::spawn(move || {
            read_lines(std::io::stdin().lock(), &hub, |line, message| {
                if !quiet {
                    errors.print_message(format_args!("standard input, line {line}: {message}"));
                }
            });
        });
    }
    let errors = Arc::clone(errors);
    let report = move |message: &str| {
        if !quiet {
            errors.print_message(message);
        }
    };
    let osc = port(&settings.device.osc).map(|at| ("OSC", "--osc", at, listen_to_osc(at, Arc::clone(hub))));
    let meshes = port(&settings.device.meshes)
        .map(|at| ("meshes", "--meshes", at, listen_to_meshes(at, Arc::clone(hub), report)));
    let mut all = Vec::new();
    for (what, option, at, listening) in osc.into_iter().chain(meshes) {
        match listening {
            Ok(listening) => {
                if !listening.at.ip().is_loopback() {
                    let message = format!("{what} at {} is accepted from other machines", listening.at);
                    let help = "anyone who reaches the port can play and set parameters; a port number without an address accepts this machine only";
                    warn(Diagnostic::general("F056", message).help(help));
                }
                all.push((what, listening));
            }
            Err(e) => {
                let message = format!("cannot listen for {what} at {at}: {e}");
                let help = format!("{option} PORT takes another port, {option} off none");
                warn(Diagnostic::general("F055", message).help(help));
            }
        }
    }
    all
}

fn warn(found: Diagnostic) {
    show(&[Diagnostic { severity: Severity::Warning, ..found }], &Sources::default());
}

/// The address of an option: a port of this machine, ADDRESS:PORT, or `off`.
fn port(text: &str) -> Option<SocketAddr> {
    // Clap has checked that it is one of them.
    let here = || Some(SocketAddr::from((Ipv4Addr::LOCALHOST, text.parse().ok()?)));
    text.parse().ok().or_else(here)
}
