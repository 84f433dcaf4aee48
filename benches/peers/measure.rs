//! Times of works, as tab-separated lines.

use std::hint::black_box;
use std::time::Instant;

/// Processor time after which no further run of a work begins, s.
const BUDGET: f64 = 15.0;

fn variable(name: &str, default: usize) -> usize {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(default).max(1)
}

pub fn runs() -> usize {
    variable("PEERS_RUNS", 5)
}

pub fn threads() -> usize {
    variable("PEERS_THREADS", 1)
}

/// Processor time of all threads of this process, s.
#[cfg(unix)]
pub fn processor_time() -> f64 {
    let time = nix::time::clock_gettime(nix::time::ClockId::CLOCK_PROCESS_CPUTIME_ID);
    time.map_or(f64::NAN, |t| t.tv_sec() as f64 + 1e-9 * t.tv_nsec() as f64)
}

/// Wall time, in place of the processor time that the system does not report, s.
#[cfg(not(unix))]
pub fn processor_time() -> f64 {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed().as_secs_f64()
}

/// Peak memory of this process in MB, if the system reports it.
pub fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.split_whitespace().next()?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}

/// Wall and processor times of the runs of a work, rising, s.
pub struct Times {
    wall: Vec<f64>,
    cpu: Vec<f64>,
}

impl Times {
    /// Runs a work once, and then as often as `PEERS_RUNS` says or the budget allows.
    pub fn of<T>(mut work: impl FnMut() -> T) -> Self {
        black_box(work());
        let (mut wall, mut cpu) = (Vec::new(), Vec::new());
        while wall.len() < runs() && cpu.iter().sum::<f64>() < BUDGET {
            let (start, before) = (Instant::now(), processor_time());
            black_box(work());
            wall.push(start.elapsed().as_secs_f64());
            cpu.push(processor_time() - before);
        }
        wall.sort_by(f64::total_cmp);
        cpu.sort_by(f64::total_cmp);
        Self { wall, cpu }
    }

    /// Median wall time and median processor time.
    pub fn medians(&self) -> [f64; 2] {
        [&self.wall, &self.cpu].map(|times| times[times.len() / 2])
    }
}

/// An item, by its name in the printed lines.
#[derive(Clone, Copy)]
pub struct Item(pub &'static str);

impl Item {
    /// Prints a figure.
    pub fn print(self, metric: &str, value: f64, unit: &str) {
        // Six digits that count.
        let digits = if value == 0.0 { 0.0 } else { 5.0 - value.abs().log10().floor() };
        let (item, digits) = (self.0, digits.clamp(0.0, 15.0) as usize);
        println!("{item}\tfoley\t{metric}\t{value:.digits$}\t{unit}");
    }

    /// Prints the figures that `value` makes of the times of a work.
    pub fn print_times(self, metric: &str, unit: &str, times: &Times, value: impl Fn(f64) -> f64) {
        let [wall, cpu] = times.medians();
        self.print(metric, value(wall), unit);
        self.print(&format!("{metric}.min"), value(times.wall[0]), unit);
        self.print(&format!("{metric}.cpu"), value(cpu), unit);
        self.print(&format!("{metric}.runs"), times.wall.len() as f64, "runs");
    }

    /// Times a work and prints seconds times `scale`.
    pub fn time<T>(self, metric: &str, scale: f64, unit: &str, work: impl FnMut() -> T) {
        self.print_times(metric, unit, &Times::of(work), |seconds| scale * seconds);
    }

    /// Times a work of a number of units and prints units per second; `.min` is the rate in the least time.
    pub fn rate<T>(self, metric: &str, units: f64, unit: &str, work: impl FnMut() -> T) {
        self.print_times(metric, unit, &Times::of(work), |seconds| units / seconds);
    }
}
