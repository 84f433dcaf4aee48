//! Cutting a signal into blocks must not change a bit.

/// Runs `process(start, block)` over `signal` in blocks of 1, 7, 64, 1000 and of everything, each with fresh state
/// from `new`, and asserts equal bits.
pub fn assert_block_invariant<S>(
    signal: &[f32],
    channels: usize,
    new: impl Fn() -> S,
    process: impl Fn(&mut S, i64, &mut [f32]),
) {
    let run = |frames: usize| -> Vec<u32> {
        let mut state = new();
        let mut out = signal.to_vec();
        for (i, block) in out.chunks_mut(frames * channels).enumerate() {
            process(&mut state, (i * frames) as i64, block);
        }
        out.iter().map(|x| x.to_bits()).collect()
    };
    let whole = run(signal.len() / channels);
    for frames in [1, 7, 64, 1000] {
        assert!(run(frames) == whole, "blocks of {frames} frames differ");
    }
}

/// A rough test signal: an impulse, then something like music.
pub fn signal(frames: usize, channels: usize) -> Vec<f32> {
    let mut out: Vec<f32> = (0..frames * channels)
        .map(|i| (0.37 * i as f32).sin() * (0.011 * i as f32).cos() * ((i * 7919 % 101) as f32 / 101.0))
        .collect();
    out[0] = 1.0;
    out
}
