//! Frames of meshes over TCP, one connection for each mesh. All numbers are little-endian:
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `foleymsh` |
//! | 4 | u32, version: 1 |
//! | 4 | u32, length of the channel's name in bytes: 1 to 200 |
//! | as many | the name, UTF-8 |
//! | 4 | u32, vertices |
//! | then for each frame 8 | f64, seconds on the sender's clock |
//! | 12 for each vertex | f32 x, y, z |
//!
//! The first frame of a connection is shown now, and the others at their times relative to the first. A frame that is early
//! waits, so a sender may send a whole file at once.

use super::hub::{Hub, Moment};
use super::listener::Listener;
use super::refusals::Refusal;
use foley_nodes::core::time::{Tick, seconds, ticks};
use foley_nodes::mesh::MAX_COORDINATE;
use std::io::{ErrorKind, Read};
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::thread::ScopedJoinHandle;
use std::time::{Duration, Instant};

/// First bytes of a connection.
pub const MAGIC: [u8; 8] = *b"foleymsh";
/// The version of the protocol.
pub const VERSION: u32 = 1;

/// Maximum bytes of the name of a channel.
const MAX_NAME_BYTES: u32 = 200;
/// Maximum number of connections at a time.
const MAX_CONNECTIONS: usize = 8;
/// Time in which a sender has to send the header.
const HEADER_TIMEOUT: Duration = Duration::from_secs(5);
/// Duration of silence after which a connection is replaced by another one.
const SILENCE: Duration = Duration::from_secs(15);
/// Maximum time for which a thread reads or sleeps before it polls the stop flag.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Time by which a frame is delivered early, s: it also waits at its node, and no sleep is exact.
const MARGIN: f64 = 0.03;
/// Maximum time by which a frame may be ahead of the graph that plays, s.
const MAX_AHEAD: f64 = 10.0;

/// The reason why a connection is refused: a message with the error found and the expected form.
#[derive(Debug)]
enum Refused {
    /// It cannot be parsed.
    Malformed(String),
    /// No node waits for it.
    Unclaimed(String),
}

fn malformed<T>(message: String) -> Result<T, Refused> {
    Err(Refused::Malformed(message))
}

/// Activity of one connection, by which the listener finds those that are silent.
struct Activity {
    start: Instant,
    /// Milliseconds from `start` to its last byte, or to the last frame that was due.
    last_ms: AtomicU64,
    /// True if another connection replaces it.
    close: AtomicBool,
}

impl Activity {
    fn new() -> Self {
        Self { start: Instant::now(), last_ms: AtomicU64::new(0), close: AtomicBool::new(false) }
    }

    fn note(&self) {
        self.last_ms.store(self.start.elapsed().as_millis() as u64, Relaxed);
    }

    fn silence(&self) -> Duration {
        self.start.elapsed().saturating_sub(Duration::from_millis(self.last_ms.load(Relaxed)))
    }
}

/// The bytes of one sender.
struct Bytes<'a, R> {
    from: R,
    stop: &'a AtomicBool,
    activity: &'a Activity,
    /// End of the time for the header.
    until: Option<Instant>,
}

impl<R: Read> Bytes<'_, R> {
    /// Fills `into`; returns false if the connection ends before the first byte, or at a stop.
    fn fill(&mut self, into: &mut [u8], what: &str) -> Result<bool, Refused> {
        let mut read = 0;
        while read < into.len() {
            if self.stop.load(Relaxed) {
                return Ok(false);
            }
            if self.activity.close.load(Relaxed) {
                let s = SILENCE.as_secs();
                return malformed(format!(
                    "it has sent nothing for {s} s, and another sender needs its connection"
                ));
            }
            match self.from.read(&mut into[read..]) {
                Ok(0) if read == 0 => return Ok(false),
                Ok(0) => {
                    return malformed(format!(
                        "it ends within {what}: {read} of {} bytes are there",
                        into.len()
                    ));
                }
                Ok(n) => {
                    read += n;
                    self.activity.note();
                }
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    if self.until.is_some_and(|until| Instant::now() > until) {
                        let s = HEADER_TIMEOUT.as_secs();
                        return malformed(format!("it has not sent its header in {s} s; {what} is missing"));
                    }
                }
                Err(e) => return malformed(format!("it broke within {what}: {e}")),
            }
        }
        Ok(true)
    }

    /// Fills `into`; the end of the connection is an error.
    fn require(&mut self, into: &mut [u8], what: &str) -> Result<bool, Refused> {
        let filled = self.fill(into, what)?;
        if !filled && !self.stop.load(Relaxed) {
            return malformed(format!("it ends before {what}"));
        }
        Ok(filled)
    }

    fn u32(&mut self, what: &str) -> Result<Option<u32>, Refused> {
        let mut bytes = [0; 4];
        Ok(self.require(&mut bytes, what)?.then(|| u32::from_le_bytes(bytes)))
    }
}

/// Reads the header: the channel, and the numbers per frame; `None` if the connection is over.
fn read_header<R: Read>(bytes: &mut Bytes<'_, R>, hub: &Hub) -> Result<Option<(String, usize)>, Refused> {
    let mut magic = [0; 8];
    if !bytes.fill(&mut magic, "the first 8 bytes")? {
        return Ok(None);
    }
    if magic != MAGIC {
        let found = String::from_utf8_lossy(&magic);
        return malformed(format!("it begins with {found:?}; \"foleymsh\" is needed"));
    }
    let Some(version) = bytes.u32("the version")? else { return Ok(None) };
    if version != VERSION {
        return malformed(format!("its version is {version}; {VERSION} is needed"));
    }
    let Some(length) = bytes.u32("the length of the channel's name")? else { return Ok(None) };
    if !(1..=MAX_NAME_BYTES).contains(&length) {
        return malformed(format!("the channel's name has {length} bytes; 1 to {MAX_NAME_BYTES} are needed"));
    }
    let mut name = vec![0; length as usize];
    if !bytes.require(&mut name, "the channel's name")? {
        return Ok(None);
    }
    let Ok(channel) = String::from_utf8(name) else {
        return malformed("the channel's name is not UTF-8".to_owned());
    };
    let Some(vertices) = bytes.u32("the number of vertices")? else { return Ok(None) };
    let known = hub.frame_channels();
    let named: Vec<_> = known.iter().filter(|(name, _)| *name == channel).map(|(_, n)| n / 3).collect();
    if named.is_empty() {
        let names: Vec<_> = known.iter().map(|(name, _)| format!("{name:?}")).collect();
        let available =
            if names.is_empty() { "has none".into() } else { format!("has {}", names.join(", ")) };
        return Err(Refused::Unclaimed(format!(
            "no LiveMesh has the channel {channel:?}; the graph {available}"
        )));
    }
    if !named.contains(&(vertices as usize)) {
        let wanted: Vec<_> = named.iter().map(ToString::to_string).collect();
        let wanted = wanted.join(" or ");
        return malformed(format!("it has {vertices} vertices; the LiveMesh of {channel:?} has {wanted}"));
    }
    Ok(Some((channel, 3 * vertices as usize)))
}

/// The origin of the times of a sender.
#[derive(Clone, Copy)]
struct TimeOrigin {
    /// Time of the first frame, s.
    time: f64,
    /// Its time in the graph that plays.
    moment: Option<Moment>,
}

impl TimeOrigin {
    fn tick(&self, time: f64) -> Tick {
        let start = self.moment.map_or(0, |moment| moment.tick);
        start.saturating_add(ticks(time - self.time))
    }
}

/// Reads and delivers all frames of a connection.
fn deliver_frames<R: Read>(bytes: &mut Bytes<'_, R>, hub: &Hub) -> Result<(), Refused> {
    let Some((channel, count)) = read_header(bytes, hub)? else { return Ok(()) };
    bytes.until = None;
    // The size is bounded by the mesh of the graph.
    let (mut raw, mut numbers) = (vec![0; 8 + 4 * count], vec![0.0_f32; count]);
    let mut origin: Option<TimeOrigin> = None;
    let mut before = f64::NEG_INFINITY;
    for frame in 0_u64.. {
        if !bytes.fill(&mut raw, &format!("frame {frame}"))? {
            break;
        }
        let (time, positions) = raw.split_at(8);
        let time = time.try_into().map_or(f64::NAN, f64::from_le_bytes);
        if !time.is_finite() {
            return malformed(format!("frame {frame} is at {time} s; a finite time is needed"));
        }
        if time <= before {
            return malformed(format!(
                "frame {frame} is at {time} s, the one before at {before} s; times must increase"
            ));
        }
        before = time;
        for (number, bytes) in numbers.iter_mut().zip(positions.as_chunks::<4>().0) {
            *number = f32::from_le_bytes(*bytes);
        }
        let wrong = numbers.iter().position(|x| x.is_nan() || x.abs() > MAX_COORDINATE);
        if let Some(vertex) = wrong.map(|k| k / 3) {
            let position = &numbers[3 * vertex..3 * vertex + 3];
            return malformed(format!(
                "vertex {vertex} of frame {frame} is at {position:?}; positions must be finite and within 1e9"
            ));
        }
        // A graph that plays from the beginning again has another clock.
        let now = hub.moment();
        let current = origin.filter(|a| a.moment.map(|m| m.piece) == now.map(|m| m.piece));
        let at = current.unwrap_or(TimeOrigin { time, moment: now });
        origin = Some(at);
        let at = at.tick(time);
        if !wait_until_due(at, frame, hub, bytes.stop)? {
            break;
        }
        bytes.activity.note();
        if !hub.deliver_frame(&channel, at, &numbers) {
            let message =
                format!("no LiveMesh has the channel {channel:?} with {} vertices any more", count / 3);
            return Err(Refused::Unclaimed(message));
        }
    }
    Ok(())
}

/// Waits until a frame is due; returns false at a stop.
fn wait_until_due(at: Tick, frame: u64, hub: &Hub, stop: &AtomicBool) -> Result<bool, Refused> {
    let piece = hub.moment().map(|now| now.piece);
    while !stop.load(Relaxed) {
        let Some(now) = hub.moment().filter(|now| Some(now.piece) == piece) else { return Ok(true) };
        let early = seconds(at.saturating_sub(now.tick));
        if early > MAX_AHEAD {
            return malformed(format!(
                "frame {frame} is {early:.1} s ahead of the graph; times must be in seconds, and at most {MAX_AHEAD} s ahead"
            ));
        }
        if early <= MARGIN {
            return Ok(true);
        }
        std::thread::sleep(Duration::from_secs_f64(early - MARGIN).min(POLL_INTERVAL));
    }
    Ok(false)
}

/// Reads the frames of one sender until it ends or `stop` is set.
///
/// # Errors
/// A message with the error found and the expected form; the error is counted already.
pub fn read_frames(from: impl Read, hub: &Hub, stop: &AtomicBool) -> Result<(), String> {
    read_active(from, hub, stop, &Activity::new())
}

fn read_active(from: impl Read, hub: &Hub, stop: &AtomicBool, activity: &Activity) -> Result<(), String> {
    let mut bytes = Bytes { from, stop, activity, until: Some(Instant::now() + HEADER_TIMEOUT) };
    deliver_frames(&mut bytes, hub).map_err(|refused| match refused {
        Refused::Malformed(message) => {
            hub.refusals.add(Refusal::Malformed);
            message
        }
        Refused::Unclaimed(message) => {
            hub.refusals.add(Refusal::Unclaimed);
            message
        }
    })
}

/// Listens for connections, up to 8 at a time on a thread each; one more takes the place of the one that has been silent longest,
/// if that is 15 s or more. Calls `report` with the errors of those that it closes.
///
/// # Errors
/// When the address cannot be bound.
pub fn listen_to_meshes(
    at: SocketAddr,
    hub: Arc<Hub>,
    report: impl Fn(&str) + Send + Sync + 'static,
) -> std::io::Result<Listener> {
    let listener = TcpListener::bind(at)?;
    listener.set_nonblocking(true)?;
    let at = listener.local_addr()?;
    Ok(Listener::start(at, move |stop| {
        std::thread::scope(|scope| {
            let mut senders: Vec<(ScopedJoinHandle<'_, ()>, Arc<Activity>)> = Vec::new();
            while !stop.load(Relaxed) {
                let Ok((stream, from)) = listener.accept() else {
                    std::thread::sleep(POLL_INTERVAL);
                    continue;
                };
                senders.retain(|(sender, _)| !sender.is_finished());
                if senders.len() >= MAX_CONNECTIONS && !close_longest_silent(&mut senders, SILENCE) {
                    hub.refusals.add(Refusal::Malformed);
                    report(&format!(
                        "mesh from {from}: {MAX_CONNECTIONS} others are connected, and no more are accepted"
                    ));
                    continue;
                }
                let ready =
                    stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(POLL_INTERVAL)));
                let (hub, report, activity) = (&hub, &report, Arc::new(Activity::new()));
                let noted = Arc::clone(&activity);
                let sender = scope.spawn(move || {
                    let read = |()| read_active(stream, hub, stop, &noted);
                    if let Err(message) = ready.map_err(|e| e.to_string()).and_then(read) {
                        report(&format!("mesh from {from}: {message}"));
                    }
                });
                senders.push((sender, activity));
            }
        });
    }))
}

/// Closes the connection that has been silent longest, if that is `silence` or more; returns true if it will be replaced.
fn close_longest_silent(
    senders: &mut Vec<(ScopedJoinHandle<'_, ()>, Arc<Activity>)>,
    silence: Duration,
) -> bool {
    let longest = (0..senders.len()).max_by_key(|&k| senders[k].1.silence());
    let Some(k) = longest.filter(|&k| senders[k].1.silence() >= silence) else { return false };
    let (sender, activity) = senders.swap_remove(k);
    activity.close.store(true, Relaxed);
    // It polls this flag.
    let _ = sender.join();
    true
}

#[cfg(test)]
mod tests;
