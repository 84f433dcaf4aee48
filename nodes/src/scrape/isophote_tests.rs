use super::*;

#[test]
fn each_point_of_a_curve_is_crossed_once() {
    // Two pieces that meet on the chord's line.
    let chord = [[0.0, 1.0], [2.0, 1.0]];
    let crosses = |ends: [[f64; 2]; 2]| {
        let [a, b] = ends.map(|p| across(&chord, p));
        let [c, d] = chord.map(|p| across(&ends, p));
        (a >= 0.0) != (b >= 0.0) && (c >= 0.0) != (d >= 0.0)
    };
    for tilt in [-0.5, 0.0, 0.7] {
        let (low, middle, high) = ([1.0 - tilt, 0.0], [1.0, 1.0], [1.0 + tilt, 2.0]);
        assert!(crosses([low, middle]) != crosses([middle, high]), "{tilt}");
    }
    // A corner that only touches it is crossed twice or not at all.
    let touch = [[[0.5, 2.0], [1.0, 1.0]], [[1.0, 1.0], [1.5, 2.0]]];
    assert_eq!(crosses(touch[0]), crosses(touch[1]));
}
