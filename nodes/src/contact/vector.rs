//! Operations on 3-vectors in double precision.

pub(crate) type Vec3 = [f64; 3];

#[inline]
pub(crate) fn widen(a: [f32; 3]) -> Vec3 {
    [f64::from(a[0]), f64::from(a[1]), f64::from(a[2])]
}

/// Converts a number to single precision; numbers beyond its range become its largest ones.
#[inline]
pub(super) fn narrow(x: f64) -> f32 {
    x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32
}

#[inline]
pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
pub(crate) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub(crate) fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

#[inline]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
pub(crate) fn norm(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// Rotates a vector by a unit quaternion (w, x, y, z): v + 2 w (u x v) + 2 u x (u x v) with u = (x, y, z).
#[inline]
pub(crate) fn rotate([w, x, y, z]: [f64; 4], v: Vec3) -> Vec3 {
    let u = [x, y, z];
    let t = scale(cross(u, v), 2.0);
    add(v, add(scale(t, w), cross(u, t)))
}

/// Rotates a vector by the inverse of a unit quaternion.
#[inline]
pub(crate) fn rotate_back([w, x, y, z]: [f64; 4], v: Vec3) -> Vec3 {
    rotate([w, -x, -y, -z], v)
}
