//! Plays a graph inside a game: the audio callback belongs to the host, and the game sends contacts and parameters.
//!
//! `cargo run --release --example live_in_a_game_loop`: two seconds on a simulated device.
use foley::Session;
use foley::live::Options;
use foley::nodes::core::input::NoInputs;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const GRAPH: &str = r#"#![schema = "foley:graph/1"]
Graph(seed: 1, params: { "level": 0.1 }, nodes: {
    "air": Noise(rate: 48000),
    "wind": LowPass(audio: "air", cutoff: 500.0),
    "soft": Gain(audio: "wind", gain: "$level"),
    "out": WavOut(audio: "soft", path: "wind.wav"),
})"#;

fn main() -> Result<(), foley::Errors> {
    let inputs = Arc::new(NoInputs);
    let mut session = Session::from_text(GRAPH, ".");
    let (mut player, mut callback) = session.play(inputs.clone(), Options::default())?;

    // The thread of the device: `fill` neither allocates nor waits.
    let over = Arc::new(AtomicBool::new(false));
    let device = std::thread::spawn({
        let over = Arc::clone(&over);
        move || {
            let (mut block, mut peak) = ([0.0_f32; 480], 0.0_f32);
            while !over.load(Ordering::Relaxed) {
                callback.fill(&mut block);
                peak = block.iter().fold(peak, |peak, x| peak.max(x.abs()));
                std::thread::sleep(Duration::from_millis(10));
            }
            peak
        }
    });

    // The loop of the game, 60 frames a second.
    for frame in 0..120 {
        for event in player.tick() {
            println!("{event:?}");
        }
        if frame == 60 {
            // Fades to the new level without a click.
            session.set("level", "0.8");
            if let Err(found) = player.load(session.live_graph(inputs.clone())?) {
                found.iter().for_each(|found| eprintln!("{}: {}", found.code, found.message));
            }
        }
        std::thread::sleep(Duration::from_micros(16_667));
    }
    over.store(true, Ordering::Relaxed);
    println!("peak {:.3}", device.join().unwrap_or_default());
    Ok(())
}
