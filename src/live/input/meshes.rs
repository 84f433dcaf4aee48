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
//! The first frame of a connection happens now, and all others as much later as their times say. What comes early waits: a sender may
//! send a whole file at once, and is slowed down to the time of what plays.

use super::hub::{Hub, Moment};
use super::listening::Listening;
use foley_nodes::core::time::{Tick, seconds, ticks};
use foley_nodes::mesh::MAX_COORDINATE;
use std::io::{ErrorKind, Read};
use std::net::{SocketAddr, TcpListener};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// What a connection begins with.
pub const MAGIC: [u8; 8] = *b"foleymsh";
/// The version of the protocol.
pub const VERSION: u32 = 1;

/// Longest name of a channel, bytes.
const LONGEST_NAME: u32 = 200;
/// Most connections at a time.
const MOST: usize = 8;
/// Time in which a sender has to say what it sends.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long a thread looks at nothing but its socket, or sleeps.
const LOOK: Duration = Duration::from_millis(50);
/// How early a frame is handed on, s: it waits at its node as well, and no sleep is exact.
const EARLY: f64 = 0.03;
/// Furthest that a frame may be ahead of what plays, s.
const AHEAD: f64 = 10.0;

/// Why a connection is closed, where it is not the sender who closes it: what was found, and what would be right.
#[derive(Debug)]
enum Refused {
    /// It cannot be understood.
    Malformed(String),
    /// No node waits for it.
    Unclaimed(String),
}

fn malformed<T>(message: String) -> Result<T, Refused> {
    Err(Refused::Malformed(message))
}

/// The bytes of one sender.
struct Bytes<'a, R> {
    from: R,
    stop: &'a AtomicBool,
    /// When it is too late.
    until: Option<Instant>,
}

impl<R: Read> Bytes<'_, R> {
    /// Fills `into`; false where it is over before the first byte, or nobody listens any more.
    fn fill(&mut self, into: &mut [u8], what: &str) -> Result<bool, Refused> {
        let mut got = 0;
        while got < into.len() {
            if self.stop.load(Relaxed) {
                return Ok(false);
            }
            match self.from.read(&mut into[got..]) {
                Ok(0) if got == 0 => return Ok(false),
                Ok(0) => {
                    return malformed(format!(
                        "it ends within {what}: {got} of {} bytes are there",
                        into.len()
                    ));
                }
                Ok(n) => got += n,
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                    if self.until.is_some_and(|until| Instant::now() > until) {
                        let s = PATIENCE.as_secs();
                        return malformed(format!(
                            "it has not said in {s} s what it sends; {what} is missing"
                        ));
                    }
                }
                Err(e) => return malformed(format!("it broke within {what}: {e}")),
            }
        }
        Ok(true)
    }

    /// Fills `into`, which has to be there.
    fn need(&mut self, into: &mut [u8], what: &str) -> Result<bool, Refused> {
        let there = self.fill(into, what)?;
        if !there && !self.stop.load(Relaxed) {
            return malformed(format!("it ends before {what}"));
        }
        Ok(there)
    }

    fn u32(&mut self, what: &str) -> Result<Option<u32>, Refused> {
        let mut bytes = [0; 4];
        Ok(self.need(&mut bytes, what)?.then(|| u32::from_le_bytes(bytes)))
    }
}

/// The channel and the numbers of each frame; `None` where the connection is over.
fn head<R: Read>(bytes: &mut Bytes<'_, R>, hub: &Hub) -> Result<Option<(String, usize)>, Refused> {
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
    if !(1..=LONGEST_NAME).contains(&length) {
        return malformed(format!("the channel's name has {length} bytes; 1 to {LONGEST_NAME} are needed"));
    }
    let mut name = vec![0; length as usize];
    if !bytes.need(&mut name, "the channel's name")? {
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
        let there = if names.is_empty() { "has none".into() } else { format!("has {}", names.join(", ")) };
        return Err(Refused::Unclaimed(format!(
            "no LiveMesh has the channel {channel:?}; the graph {there}"
        )));
    }
    if !named.contains(&(vertices as usize)) {
        let wanted: Vec<_> = named.iter().map(ToString::to_string).collect();
        let wanted = wanted.join(" or ");
        return malformed(format!("it has {vertices} vertices; the LiveMesh of {channel:?} has {wanted}"));
    }
    Ok(Some((channel, 3 * vertices as usize)))
}

/// What the times of a sender mean.
#[derive(Clone, Copy)]
struct Anchor {
    time: f64,
    moment: Option<Moment>,
}

impl Anchor {
    fn tick(&self, time: f64) -> Tick {
        let start = self.moment.map_or(0, |moment| moment.tick);
        start.saturating_add(ticks(time - self.time))
    }
}

fn frames<R: Read>(bytes: &mut Bytes<'_, R>, hub: &Hub) -> Result<(), Refused> {
    let Some((channel, count)) = head(bytes, hub)? else { return Ok(()) };
    bytes.until = None;
    // As many as the graph's own mesh has.
    let (mut raw, mut numbers) = (vec![0; 8 + 4 * count], vec![0.0_f32; count]);
    let mut anchor: Option<Anchor> = None;
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
                "frame {frame} is at {time} s, the one before at {before} s; times have to grow"
            ));
        }
        before = time;
        for (number, bytes) in numbers.iter_mut().zip(positions.as_chunks::<4>().0) {
            *number = f32::from_le_bytes(*bytes);
        }
        let wrong = numbers.iter().position(|x| x.is_nan() || x.abs() > MAX_COORDINATE);
        if let Some(vertex) = wrong.map(|k| k / 3) {
            let place = &numbers[3 * vertex..3 * vertex + 3];
            return malformed(format!(
                "vertex {vertex} of frame {frame} is at {place:?}; positions must be finite and within 1e9"
            ));
        }
        // Whatever plays from the beginning again has another clock.
        let now = hub.moment();
        let held = anchor.filter(|a| a.moment.map(|m| m.piece) == now.map(|m| m.piece));
        let at = held.unwrap_or(Anchor { time, moment: now });
        anchor = Some(at);
        let at = at.tick(time);
        if !due(at, frame, hub, bytes.stop)? {
            break;
        }
        if !hub.deliver_frame(&channel, at, &numbers) {
            let message =
                format!("no LiveMesh has the channel {channel:?} with {} vertices any more", count / 3);
            return Err(Refused::Unclaimed(message));
        }
    }
    Ok(())
}

/// Waits until a frame is due; false where nobody listens any more.
fn due(at: Tick, frame: u64, hub: &Hub, stop: &AtomicBool) -> Result<bool, Refused> {
    let piece = hub.moment().map(|now| now.piece);
    while !stop.load(Relaxed) {
        let Some(now) = hub.moment().filter(|now| Some(now.piece) == piece) else { return Ok(true) };
        let early = seconds(at.saturating_sub(now.tick));
        if early > AHEAD {
            return malformed(format!(
                "frame {frame} is {early:.1} s ahead of what plays; times have to be seconds, and at most {AHEAD} s ahead"
            ));
        }
        if early <= EARLY {
            return Ok(true);
        }
        std::thread::sleep(Duration::from_secs_f64(early - EARLY).min(LOOK));
    }
    Ok(false)
}

/// Takes what one sender sends, until it ends or nobody listens any more.
///
/// # Errors
/// What was found and what would be right; it is counted already.
pub fn take_frames(from: impl Read, hub: &Hub, stop: &AtomicBool) -> Result<(), String> {
    let mut bytes = Bytes { from, stop, until: Some(Instant::now() + PATIENCE) };
    frames(&mut bytes, hub).map_err(|refused| match refused {
        Refused::Malformed(message) => {
            hub.reject();
            message
        }
        Refused::Unclaimed(message) => {
            hub.unclaimed.fetch_add(1, Relaxed);
            message
        }
    })
}

/// Takes connections, up to 8 at a time on a thread each; tells of those that it closes.
///
/// # Errors
/// When the address cannot be had.
pub fn listen_to_meshes(
    at: SocketAddr,
    hub: Arc<Hub>,
    tell: impl Fn(&str) + Send + Sync + 'static,
) -> std::io::Result<Listening> {
    let listener = TcpListener::bind(at)?;
    listener.set_nonblocking(true)?;
    let at = listener.local_addr()?;
    Ok(Listening::start(at, move |stop| {
        std::thread::scope(|scope| {
            let mut senders = Vec::new();
            while !stop.load(Relaxed) {
                let Ok((stream, from)) = listener.accept() else {
                    std::thread::sleep(LOOK);
                    continue;
                };
                senders.retain(|sender: &std::thread::ScopedJoinHandle<'_, ()>| !sender.is_finished());
                if senders.len() >= MOST {
                    hub.reject();
                    tell(&format!("mesh from {from}: {MOST} others are sent already, and no more are taken"));
                    continue;
                }
                let ready = stream.set_nonblocking(false).and_then(|()| stream.set_read_timeout(Some(LOOK)));
                let (hub, tell) = (&hub, &tell);
                senders.push(scope.spawn(move || {
                    let taken =
                        ready.map_err(|e| e.to_string()).and_then(|()| take_frames(stream, hub, stop));
                    if let Err(message) = taken {
                        tell(&format!("mesh from {from}: {message}"));
                    }
                }));
            }
        });
    }))
}

#[cfg(test)]
mod tests {
    use super::super::super::callback::Shared;
    use super::*;
    use crossbeam_channel::unbounded;
    use foley_nodes::core::input::Inputs;
    use foley_nodes::core::random::Rng;
    use foley_nodes::core::time::Rate;
    use std::io::Write;
    use std::net::TcpStream;
    use std::sync::Mutex;

    fn hub() -> Arc<Hub> {
        Arc::new(Hub::new(unbounded().0))
    }

    fn begin(channel: &str, vertices: u32) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((channel.len() as u32).to_le_bytes());
        bytes.extend(channel.as_bytes());
        bytes.extend(vertices.to_le_bytes());
        bytes
    }

    /// Two vertices at one place.
    fn frame(time: f64, x: f32) -> Vec<u8> {
        let mut bytes = time.to_le_bytes().to_vec();
        [x; 6].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        bytes
    }

    fn take(bytes: &[u8], hub: &Hub) -> Result<(), String> {
        take_frames(bytes, hub, &AtomicBool::new(false))
    }

    #[test]
    fn frames_keep_their_distances_in_time() {
        let hub = hub();
        let mut inbox = hub.open_frames("sheet", 6).unwrap();
        let times = [1000.0, 1000.25, 1000.75];
        let mut bytes = begin("sheet", 2);
        times.iter().for_each(|t| bytes.extend(frame(*t, *t as f32)));
        take(&bytes, &hub).unwrap();
        let mut shown = [0.0; 6];
        for (k, time) in times.iter().enumerate() {
            let at = ticks(time - times[0]);
            assert_eq!(inbox.latest(at + 1, &mut shown), Some(at), "{k}");
            assert_eq!(shown, [*time as f32; 6]);
        }
        take(&[], &hub).unwrap();
        take(&begin("sheet", 2), &hub).unwrap();
        assert_eq!((hub.delivered.load(Relaxed), hub.malformed.load(Relaxed)), (3, 0));
    }

    #[test]
    fn what_is_wrong_is_told_with_what_would_be_right() {
        let hub = hub();
        let _inboxes = [hub.open_frames("sheet", 6), hub.open_frames("shirt", 9)];
        let after = |bytes: &[u8]| [begin("sheet", 2).as_slice(), bytes].concat();
        let mut version = begin("sheet", 2);
        version[8] = 2;
        let mut name = begin("sheet", 2);
        name[16] = 0xff;
        let long = |length: u32| [&begin("sheet", 2)[..12], &length.to_le_bytes()].concat();
        let cases: Vec<(Vec<u8>, &str)> = vec![
            (b"GET / HTTP/1.1".to_vec(), "it begins with \"GET / HT\"; \"foleymsh\" is needed"),
            (version, "its version is 2; 1 is needed"),
            (long(0), "the channel's name has 0 bytes; 1 to 200"),
            (long(u32::MAX), "the channel's name has 4294967295 bytes"),
            (name, "not UTF-8"),
            (begin("sheet", 3), "it has 3 vertices; the LiveMesh of \"sheet\" has 2"),
            (begin("sheet", u32::MAX), "it has 4294967295 vertices"),
            (begin("sheet", 2)[..18].to_vec(), "it ends within the channel's name: 2 of 5 bytes"),
            (begin("sheet", 2)[..21].to_vec(), "it ends before the number of vertices"),
            (MAGIC[..3].to_vec(), "it ends within the first 8 bytes"),
            (after(&frame(0.0, 1.0)[..31]), "it ends within frame 0: 31 of 32 bytes"),
            (after(&frame(f64::NAN, 1.0)), "frame 0 is at NaN s; a finite time"),
            (
                after(&[frame(2.0, 1.0), frame(1.0, 1.0)].concat()),
                "frame 1 is at 1 s, the one before at 2 s; times have to grow",
            ),
            (after(&[frame(2.0, 1.0), frame(2.0, 1.0)].concat()), "times have to grow"),
            (
                after(&frame(0.0, f32::NAN)),
                "vertex 0 of frame 0 is at [NaN, NaN, NaN]; positions must be finite",
            ),
            (after(&[frame(0.0, 1.0), frame(1.0, 1.1e9)].concat()), "vertex 0 of frame 1"),
            (after(&frame(0.0, f32::NEG_INFINITY)), "within 1e9"),
        ];
        for (k, (bytes, wanted)) in cases.iter().enumerate() {
            let found = take(bytes, &hub).unwrap_err();
            assert!(found.contains(wanted), "{found}");
            assert_eq!(hub.malformed.load(Relaxed), k as u64 + 1);
        }
        let found = take(&begin("coat", 2), &hub).unwrap_err();
        assert_eq!(found, "no LiveMesh has the channel \"coat\"; the graph has \"sheet\", \"shirt\"");
        assert_eq!(hub.malformed.load(Relaxed), cases.len() as u64);
    }

    #[test]
    fn no_bytes_do_harm() {
        let hub = hub();
        let mut good = begin("sheet", 2);
        (0..4).for_each(|k| good.extend(frame(f64::from(k) * 0.1, k as f32)));
        let mut shown = [0.0; 6];
        for seed in 0..5000 {
            let mut draw = Rng::new(seed);
            let mut bytes = good.clone();
            for _ in 0..1 + draw.below(4) {
                let at = draw.below(bytes.len());
                match draw.below(4) {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] = draw.below(256) as u8,
                    2 => bytes.insert(at, draw.below(256) as u8),
                    _ => bytes.push(draw.below(256) as u8),
                }
            }
            // Another piece each time: without a clock all begin at 0.
            let mut inbox = hub.open_frames("sheet", 6).unwrap();
            let _ = take(&bytes, &hub);
            inbox.latest(Tick::MAX, &mut shown);
            assert!(shown.iter().all(|x| x.abs() <= MAX_COORDINATE), "{seed}: {shown:?}");
        }
        assert!(hub.malformed.load(Relaxed) > 1000 && hub.delivered.load(Relaxed) > 1000);
    }

    /// A hub whose piece has come to a window of a hundredth of a second, with workers ten windows ahead.
    fn playing() -> (Arc<Hub>, Arc<Shared>) {
        let (hub, shared) = (hub(), Arc::new(Shared::default()));
        shared.window.store(100, Relaxed);
        hub.set_clock(Arc::clone(&shared), Rate::hz(1000), 10, 10);
        (hub, shared)
    }

    #[test]
    fn the_first_frame_is_shown_where_workers_are_and_one_that_is_early_waits() {
        let (hub, shared) = playing();
        let mut inbox = hub.open_frames("sheet", 6).unwrap();
        let bytes = [begin("sheet", 2), frame(50.0, 1.0), frame(50.5, 2.0)].concat();
        std::thread::scope(|scope| {
            let taken = scope.spawn(|| take(&bytes, &hub));
            while hub.delivered.load(Relaxed) < 1 {
                std::thread::yield_now();
            }
            let mut shown = [0.0; 6];
            assert_eq!(inbox.latest(Tick::MAX, &mut shown), Some(ticks(1.1)));
            assert!(!taken.is_finished(), "the second is half a second early");
            assert_eq!(hub.delivered.load(Relaxed), 1);
            shared.window.store(150, Relaxed);
            taken.join().unwrap().unwrap();
            assert_eq!(inbox.latest(Tick::MAX, &mut shown), Some(ticks(1.6)));
        });
    }

    #[test]
    fn a_time_far_ahead_is_refused_and_another_piece_begins_with_its_own() {
        let (hub, shared) = playing();
        let mut inbox = hub.open_frames("sheet", 6).unwrap();
        let bytes = [begin("sheet", 2), frame(0.0, 1.0), frame(1000.0, 2.0)].concat();
        let found = take(&bytes, &hub).unwrap_err();
        assert!(found.contains("frame 1 is 1000.0 s ahead of what plays"), "{found}");
        let mut shown = [0.0; 6];
        inbox.latest(Tick::MAX, &mut shown);
        /// The piece begins again before the second frame is read.
        struct Again<'a>(&'a [u8], &'a dyn Fn(), bool);
        impl Read for Again<'_> {
            fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
                if self.0.len() == 32 && !std::mem::replace(&mut self.2, true) {
                    self.1();
                }
                self.0.read(into)
            }
        }
        let again = || {
            shared.window.store(0, Relaxed);
            hub.set_clock(Arc::clone(&shared), Rate::hz(1000), 10, 10);
        };
        let bytes = [begin("sheet", 2), frame(0.0, 1.0), frame(5.0, 2.0)].concat();
        let mut inbox = hub.open_frames("sheet", 6).unwrap();
        take_frames(Again(&bytes, &again, false), &hub, &AtomicBool::new(false)).unwrap();
        assert_eq!(inbox.latest(ticks(0.2), &mut shown), None, "its time is before that of the old piece");
        let mut inbox = hub.open_frames("sheet", 6).unwrap();
        take(&[begin("sheet", 2), frame(7.0, 1.0)].concat(), &hub).unwrap();
        assert_eq!(inbox.latest(ticks(0.2), &mut shown), Some(ticks(0.1)));
    }

    #[test]
    fn frames_come_over_the_network_and_a_wrong_sender_is_told_of() {
        let hub = hub();
        let mut inbox = hub.open_frames("sheet", 6).unwrap();
        let told = Arc::new(Mutex::new(Vec::new()));
        let noted = Arc::clone(&told);
        let tell = move |message: &str| noted.lock().unwrap().push(message.to_owned());
        let listening = listen_to_meshes("127.0.0.1:0".parse().unwrap(), Arc::clone(&hub), tell).unwrap();
        let wait = |what: &dyn Fn() -> bool| {
            (0..500).any(|_| {
                std::thread::sleep(Duration::from_millis(10));
                what()
            })
        };
        let mut good = TcpStream::connect(listening.at).unwrap();
        let bytes = [begin("sheet", 2), frame(3.0, 4.0)].concat();
        // It may come in pieces.
        for piece in bytes.chunks(7) {
            good.write_all(piece).unwrap();
        }
        let mut bad = TcpStream::connect(listening.at).unwrap();
        bad.write_all(&begin("sheet", 77)).unwrap();
        assert!(wait(&|| hub.delivered.load(Relaxed) == 1 && !told.lock().unwrap().is_empty()));
        let mut shown = [0.0; 6];
        assert_eq!((inbox.latest(1, &mut shown), shown), (Some(0), [4.0; 6]));
        let message = told.lock().unwrap()[0].clone();
        assert!(message.starts_with("mesh from 127.0.0.1:") && message.contains("77 vertices"), "{message}");
        assert!(wait(&|| matches!((&bad).read(&mut [0]), Ok(0) | Err(_))), "it is closed");
        // One that is still connected does not keep the listener.
        drop(listening);
        // More than are taken at a time.
        let listening = listen_to_meshes("127.0.0.1:0".parse().unwrap(), Arc::clone(&hub), {
            let told = Arc::clone(&told);
            move |message: &str| told.lock().unwrap().push(message.to_owned())
        })
        .unwrap();
        let many: Vec<_> = (0..=MOST).map(|_| TcpStream::connect(listening.at).unwrap()).collect();
        assert!(wait(&|| told.lock().unwrap().iter().any(|m| m.contains("8 others are sent already"))));
        drop((listening, many));
    }
}
