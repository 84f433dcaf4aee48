//! Sends the motion of a PC2 point cache to a `LiveMesh` in real time.
//!
//! ```text
//! foley live graphs/cloth/live_mesh.ron --meshes 9001
//! cargo run --example send_mesh -- 127.0.0.1:9001 sheet graphs/assets/cloth/cotton_sheet_drag_drop_crumple
//! ```
//!
//! The last argument is the path of the `.pc2`, and of the `.obj` with its faces, without the ending.
#![forbid(unsafe_code)]

use anyhow::Context as _;
use foley_nodes::mesh::{ObjMesh, ReadOptions, open_pc2};
use std::fs::File;
use std::io::{BufReader, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Frame rate, which a PC2 file does not store.
const FRAMES_PER_SECOND: f64 = 60.0;

fn main() -> anyhow::Result<()> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [address, channel, path] = args.as_slice() else {
        anyhow::bail!("send_mesh ADDRESS:PORT CHANNEL PATH, where PATH.obj and PATH.pc2 are read");
    };
    let options = ReadOptions::default();
    let obj = std::fs::read(format!("{path}.obj")).with_context(|| format!("{path}.obj"))?;
    let base = ObjMesh::parse(&obj, None, &options.limits)?;
    let cache = File::open(format!("{path}.pc2")).with_context(|| format!("{path}.pc2"))?;
    let mut cache = open_pc2(Box::new(BufReader::new(cache)), &base, FRAMES_PER_SECOND, &options)?;
    let vertices = cache.clip.topology().vertex_count();

    let mut stream = TcpStream::connect(address).with_context(|| address.clone())?;
    stream.set_nodelay(true)?;
    let mut bytes = b"foleymsh".to_vec();
    for number in [1, channel.len() as u32] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(channel.as_bytes());
    bytes.extend((vertices as u32).to_le_bytes());
    stream.write_all(&bytes)?;

    let start = Instant::now();
    let mut positions = vec![[0.0_f32; 3]; vertices];
    for (frame, time) in cache.clip.times().to_vec().into_iter().enumerate() {
        cache.frames.read_frame(frame, &mut positions)?;
        let due = Duration::try_from_secs_f64(time - cache.clip.times()[0])?;
        std::thread::sleep(due.saturating_sub(start.elapsed()));
        bytes.clear();
        bytes.extend(time.to_le_bytes());
        positions.as_flattened().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        stream.write_all(&bytes)?;
    }
    Ok(())
}
