//! Connections with right and wrong frames.

use super::*;
use crate::live::checks::{check_frames, seeds};
use crate::live::playback::callback::Shared;
use foley_nodes::core::input::Inputs;
use foley_nodes::core::random::Rng;
use foley_nodes::core::time::Rate;
use std::io::Write;
use std::net::TcpStream;
use std::sync::Mutex;

fn hub() -> Arc<Hub> {
    Arc::new(Hub::new())
}

fn begin(channel: &str, vertices: u32) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((channel.len() as u32).to_le_bytes());
    bytes.extend(channel.as_bytes());
    bytes.extend(vertices.to_le_bytes());
    bytes
}

/// Two vertices with the same position.
fn frame(time: f64, x: f32) -> Vec<u8> {
    let mut bytes = time.to_le_bytes().to_vec();
    [x; 6].iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    bytes
}

fn read(bytes: &[u8], hub: &Hub) -> Result<(), String> {
    read_frames(bytes, hub, &AtomicBool::new(false))
}

#[test]
fn frames_keep_their_intervals() {
    let hub = hub();
    let mut inbox = hub.open_frames("sheet", 6).unwrap();
    let times = [1000.0, 1000.25, 1000.75];
    let mut bytes = begin("sheet", 2);
    times.iter().for_each(|t| bytes.extend(frame(*t, *t as f32)));
    read(&bytes, &hub).unwrap();
    let mut shown = [0.0; 6];
    for (k, time) in times.iter().enumerate() {
        let at = ticks(time - times[0]);
        assert_eq!(inbox.latest(at + 1, &mut shown), Some(at), "{k}");
        assert_eq!(shown, [*time as f32; 6]);
    }
    read(&[], &hub).unwrap();
    read(&begin("sheet", 2), &hub).unwrap();
    assert_eq!((hub.delivered.load(Relaxed), hub.refusals.count(Refusal::Malformed)), (3, 0));
}

#[test]
fn errors_name_the_expected_form() {
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
            "frame 1 is at 1 s, the one before at 2 s; times must increase",
        ),
        (after(&[frame(2.0, 1.0), frame(2.0, 1.0)].concat()), "times must increase"),
        (after(&frame(0.0, f32::NAN)), "vertex 0 of frame 0 is at [NaN, NaN, NaN]; positions must be finite"),
        (after(&[frame(0.0, 1.0), frame(1.0, 1.1e9)].concat()), "vertex 0 of frame 1"),
        (after(&frame(0.0, f32::NEG_INFINITY)), "within 1e9"),
    ];
    for (k, (bytes, wanted)) in cases.iter().enumerate() {
        let found = read(bytes, &hub).unwrap_err();
        assert!(found.contains(wanted), "{found}");
        assert_eq!(hub.refusals.count(Refusal::Malformed), k as u64 + 1);
    }
    let found = read(&begin("coat", 2), &hub).unwrap_err();
    assert_eq!(found, "no LiveMesh has the channel \"coat\"; the graph has \"sheet\", \"shirt\"");
    assert_eq!(hub.refusals.count(Refusal::Malformed), cases.len() as u64);
}

#[test]
fn damaged_bytes_are_refused_or_give_frames_that_a_mesh_can_have() {
    let mut good = begin("sheet", 2);
    (0..4).for_each(|k| good.extend(frame(f64::from(k) * 0.1, k as f32)));
    for seed in seeds(5000) {
        let mut rng = Rng::new(seed);
        let mut bytes = good.clone();
        for _ in 0..1 + rng.below(4) {
            let at = rng.below(bytes.len());
            match rng.below(4) {
                0 => bytes.truncate(at.max(1)),
                1 => bytes[at] = rng.below(256) as u8,
                2 => bytes.insert(at, rng.below(256) as u8),
                _ => bytes.push(rng.below(256) as u8),
            }
        }
        check_frames(&bytes);
    }
}

/// A hub of a graph that has played 100 windows of 10 ms, with workers 10 windows ahead.
fn playing() -> (Arc<Hub>, Arc<Shared>) {
    let (hub, shared) = (hub(), Arc::new(Shared::default()));
    shared.window.store(100, Relaxed);
    hub.set_clock(Arc::clone(&shared), Rate::hz(1000), 10, 10);
    (hub, shared)
}

#[test]
fn the_first_frame_is_shown_at_the_time_of_the_workers_and_an_early_one_waits() {
    let (hub, shared) = playing();
    let mut inbox = hub.open_frames("sheet", 6).unwrap();
    let bytes = [begin("sheet", 2), frame(50.0, 1.0), frame(50.5, 2.0)].concat();
    std::thread::scope(|scope| {
        let reader = scope.spawn(|| read(&bytes, &hub));
        while hub.delivered.load(Relaxed) < 1 {
            std::thread::yield_now();
        }
        let mut shown = [0.0; 6];
        assert_eq!(inbox.latest(Tick::MAX, &mut shown), Some(ticks(1.1)));
        assert!(!reader.is_finished(), "the second is half a second early");
        assert_eq!(hub.delivered.load(Relaxed), 1);
        shared.window.store(150, Relaxed);
        reader.join().unwrap().unwrap();
        assert_eq!(inbox.latest(Tick::MAX, &mut shown), Some(ticks(1.6)));
    });
}

#[test]
fn a_time_far_ahead_is_refused_and_another_piece_begins_with_its_own() {
    let (hub, shared) = playing();
    let mut inbox = hub.open_frames("sheet", 6).unwrap();
    let bytes = [begin("sheet", 2), frame(0.0, 1.0), frame(1000.0, 2.0)].concat();
    let found = read(&bytes, &hub).unwrap_err();
    assert!(found.contains("frame 1 is 1000.0 s ahead of the graph"), "{found}");
    let mut shown = [0.0; 6];
    inbox.latest(Tick::MAX, &mut shown);
    /// The piece begins again before the second frame is read.
    struct Restart<'a>(&'a [u8], &'a dyn Fn(), bool);
    impl Read for Restart<'_> {
        fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
            if self.0.len() == 32 && !std::mem::replace(&mut self.2, true) {
                self.1();
            }
            self.0.read(into)
        }
    }
    let restart = || {
        shared.window.store(0, Relaxed);
        hub.set_clock(Arc::clone(&shared), Rate::hz(1000), 10, 10);
    };
    let bytes = [begin("sheet", 2), frame(0.0, 1.0), frame(5.0, 2.0)].concat();
    let mut inbox = hub.open_frames("sheet", 6).unwrap();
    read_frames(Restart(&bytes, &restart, false), &hub, &AtomicBool::new(false)).unwrap();
    assert_eq!(inbox.latest(ticks(0.2), &mut shown), None, "its time is before that of the old piece");
    let mut inbox = hub.open_frames("sheet", 6).unwrap();
    read(&[begin("sheet", 2), frame(7.0, 1.0)].concat(), &hub).unwrap();
    assert_eq!(inbox.latest(ticks(0.2), &mut shown), Some(ticks(0.1)));
}

#[test]
fn a_connection_that_is_silent_gives_its_place_to_another() {
    std::thread::scope(|scope| {
        let connect = |last_ms: u64| {
            let start = Instant::now().checked_sub(Duration::from_secs(20)).unwrap();
            let activity =
                Arc::new(Activity { start, last_ms: AtomicU64::new(last_ms), close: AtomicBool::new(false) });
            let read = Arc::clone(&activity);
            let sender = scope.spawn(move || {
                let stop = AtomicBool::new(false);
                let mut bytes = Bytes { from: Waits, stop: &stop, activity: &read, until: None };
                let found = bytes.fill(&mut [0], "frame 0");
                assert!(
                    matches!(found, Err(Refused::Malformed(message)) if message.contains("nothing for 15 s"))
                );
            });
            (sender, activity)
        };
        let mut senders: Vec<_> = [19_000, 1000, 10_000].map(connect).into();
        assert!(close_longest_silent(&mut senders, SILENCE));
        let left: Vec<_> = senders.iter().map(|(_, activity)| activity.last_ms.load(Relaxed)).collect();
        assert_eq!((left.len(), left.contains(&1000)), (2, false));
        assert!(!close_longest_silent(&mut senders, SILENCE), "the others are not silent for long enough");
        senders.iter().for_each(|(_, activity)| activity.close.store(true, Relaxed));
    });
}

/// A connection on which nothing comes.
struct Waits;

impl Read for Waits {
    fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
        std::thread::sleep(Duration::from_millis(1));
        Err(ErrorKind::WouldBlock.into())
    }
}

#[test]
fn frames_arrive_over_the_network_and_a_wrong_sender_is_reported() {
    let hub = hub();
    let mut inbox = hub.open_frames("sheet", 6).unwrap();
    let reports = Arc::new(Mutex::new(Vec::new()));
    let sink = Arc::clone(&reports);
    let report = move |message: &str| sink.lock().unwrap().push(message.to_owned());
    let listening = listen_to_meshes("127.0.0.1:0".parse().unwrap(), Arc::clone(&hub), report).unwrap();
    let wait = |what: &dyn Fn() -> bool| {
        (0..500).any(|_| {
            std::thread::sleep(Duration::from_millis(10));
            what()
        })
    };
    let mut good = TcpStream::connect(listening.at).unwrap();
    let bytes = [begin("sheet", 2), frame(3.0, 4.0)].concat();
    // It may arrive in pieces.
    for piece in bytes.chunks(7) {
        good.write_all(piece).unwrap();
    }
    let mut bad = TcpStream::connect(listening.at).unwrap();
    bad.write_all(&begin("sheet", 77)).unwrap();
    assert!(wait(&|| hub.delivered.load(Relaxed) == 1 && !reports.lock().unwrap().is_empty()));
    let mut shown = [0.0; 6];
    assert_eq!((inbox.latest(1, &mut shown), shown), (Some(0), [4.0; 6]));
    let message = reports.lock().unwrap()[0].clone();
    assert!(message.starts_with("mesh from 127.0.0.1:") && message.contains("77 vertices"), "{message}");
    assert!(wait(&|| matches!((&bad).read(&mut [0]), Ok(0) | Err(_))), "it is closed");
    // An open connection does not block the listener.
    drop(listening);
    // More connections than are accepted.
    let listening = listen_to_meshes("127.0.0.1:0".parse().unwrap(), Arc::clone(&hub), {
        let reports = Arc::clone(&reports);
        move |message: &str| reports.lock().unwrap().push(message.to_owned())
    })
    .unwrap();
    let many: Vec<_> = (0..=MAX_CONNECTIONS).map(|_| TcpStream::connect(listening.at).unwrap()).collect();
    assert!(wait(&|| reports.lock().unwrap().iter().any(|m| m.contains("8 others are connected"))));
    drop((listening, many));
}
