//! Values of arguments.

use crate::graph::Override;

pub(super) fn parse_set(text: &str) -> Result<Override, String> {
    match text.split_once('=') {
        Some((target, value)) if !target.trim().is_empty() => {
            Ok(Override { target: target.trim().to_owned(), value: value.to_owned() })
        }
        _ => Err("write NAME=VALUE or NODE.PARAM=VALUE".into()),
    }
}

pub(super) fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "a number of seconds".to_owned())?;
    if (1e-6..=1e7).contains(&seconds) {
        Ok(seconds)
    } else {
        Err("from 0.000001 to 10000000 seconds".into())
    }
}

pub(super) fn parse_time(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "a number of seconds".to_owned())?;
    if (0.0..=1e7).contains(&seconds) { Ok(seconds) } else { Err("from 0 to 10000000 seconds".into()) }
}

pub(super) fn parse_pause(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "a number of seconds".to_owned())?;
    let known = seconds == 0.0 || (1e-3..=1e7).contains(&seconds);
    known.then_some(seconds).ok_or_else(|| "0, or from 0.001 to 10000000 seconds".to_owned())
}

pub(super) fn parse_threads(text: &str) -> Result<usize, String> {
    let found = text.parse().ok().filter(|n| (1..=1024).contains(n));
    found.ok_or_else(|| "from 1 to 1024 threads".to_owned())
}

pub(super) fn parse_quantum(text: &str) -> Result<usize, String> {
    let found = text.parse().ok().filter(|n| (16..=8192).contains(n));
    found.ok_or_else(|| "from 16 to 8192 frames".to_owned())
}

pub(super) fn parse_port(text: &str) -> Result<String, String> {
    let fits = text == "off" || text.parse::<u16>().is_ok() || text.parse::<std::net::SocketAddr>().is_ok();
    if fits { Ok(text.to_owned()) } else { Err("a port, ADDRESS:PORT, or off".into()) }
}

/// A size such as `512M` or `4G`.
pub(super) fn parse_size(text: &str) -> Result<usize, String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_alphabetic());
    let scale: u64 = match text[digits.len()..].to_lowercase().as_str() {
        "" | "b" => 1,
        "k" | "kb" | "kib" => 1 << 10,
        "m" | "mb" | "mib" => 1 << 20,
        "g" | "gb" | "gib" => 1 << 30,
        "t" | "tb" | "tib" => 1 << 40,
        unit => return Err(format!("{unit:?} is no unit of size: K, M, G or T")),
    };
    let number: f64 = digits.parse().map_err(|_| "a size such as 512M".to_owned())?;
    let bytes = number * scale as f64;
    if (1.0..9e15).contains(&bytes) { Ok(bytes as usize) } else { Err("a size from 1 byte to 8185T".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_have_units() {
        assert_eq!(parse_size("512M"), Ok(512 << 20));
        assert_eq!(parse_size("1.5 GiB".replace(' ', "").as_str()), Ok(3 << 29));
        assert!(parse_size("12X").is_err());
        assert!(parse_size("-1G").is_err());
    }
}
