//! Tests that the cut of a signal into blocks does not change its bits.

/// Asserts that `process(start, block)` writes the same bits in blocks of 1, 7, 64 and 1000 frames as in one block.
/// Each run starts with a new state from `new`.
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
    let expected = run(signal.len() / channels);
    for frames in [1, 7, 64, 1000] {
        assert!(run(frames) == expected, "blocks of {frames} frames differ");
    }
}

/// A test signal: an impulse, then a modulated tone.
pub fn signal(frames: usize, channels: usize) -> Vec<f32> {
    let mut out: Vec<f32> = (0..frames * channels)
        .map(|i| (0.37 * i as f32).sin() * (0.011 * i as f32).cos() * ((i * 7919 % 101) as f32 / 101.0))
        .collect();
    out[0] = 1.0;
    out
}
