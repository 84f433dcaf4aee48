//! The scene, and its contacts as the physics engine reports them. Metres, z up.

use rapier3d::prelude::*;

const RADIUS: f32 = 0.05;
/// Half the length of the axis of the capsule.
const HALF_AXIS: f32 = 0.06;
/// Sine of the tilt from which the capsule touches with one end alone.
const TILT: f32 = 0.05;
/// Change of speed by one key, and speed of a jump, m/s.
const PUSH: f32 = 0.35;
const JUMP: f32 = 1.8;
/// Length of a tile with its gap, and the gap, as in the image `tiles.png` of `live.ron`.
const TILE: f32 = 0.1;
const GAP: f32 = 0.004;
/// Tiles along each side. An odd number, so that one lies in the middle and gaps at 0.05 m from it and each 0.1 m on, as in the image.
const TILES: i32 = 23;
/// Seconds from one kick to the next.
const KICK: f32 = 6.0;
/// Densities of a marble ball and of a wooden capsule, kg/m^3.
const DENSITIES: [f32; 2] = [2700.0, 700.0];

/// Body that rolls on the floor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Roller {
    /// A ball that is kicked every few seconds.
    Ball,
    /// A capsule that a person steers.
    Capsule,
}

/// One contact in one frame; body 0 is the floor, 1 the ball or capsule, 2 the walls.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    pub id: i32,
    pub bodies: [i32; 2],
    pub point: [f32; 3],
    /// Normal from the first body to the second.
    pub normal: [f32; 3],
    /// N s within the frame.
    pub impulse: f32,
    /// Velocity of the second body relative to the first, m/s.
    pub velocity: [f32; 3],
    pub approach: f32,
    pub mass: f32,
    /// Velocity of the contact point over the first body.
    pub travel: [f32; 3],
    pub ends: bool,
}

pub struct Scene {
    world: PhysicsWorld,
    ball: RigidBodyHandle,
    ball_shape: ColliderHandle,
    walls: Vec<ColliderHandle>,
    /// True for contacts in the last frame: with the floor, with the walls.
    touched: [bool; 2],
    time: f32,
    kicked: i32,
    roller: Roller,
}

/// A number from -1 to 1 for each pair of numbers, the same in every run.
fn scatter(x: i32, y: i32) -> f32 {
    let mut h = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 15)).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ (h >> 12)).wrapping_mul(0x297a_2d39);
    ((h ^ (h >> 15)) as f32 / u32::MAX as f32) * 2.0 - 1.0
}

impl Scene {
    pub fn new(step: f32, roller: Roller) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(0.0, 0.0, -9.81);
        world.integration_parameters.dt = step;
        let half = TILE * TILES as f32 / 2.0;
        for (x, y) in (0..TILES).flat_map(|x| (0..TILES).map(move |y| (x, y))) {
            // No tile lies quite level with its neighbours.
            let rise = 0.0003 * scatter(x, y);
            let location = |k: i32| (k as f32 + 0.5) * TILE - half;
            let side = (TILE - GAP) / 2.0;
            let tile = ColliderBuilder::cuboid(side, side, 0.05)
                .translation(Vector::new(location(x), location(y), rise - 0.05))
                .friction(0.4)
                .restitution(0.5);
            world.insert_collider(tile, None);
        }
        // Below the gaps.
        let ground = ColliderBuilder::cuboid(half, half, 0.05).translation(Vector::new(0.0, 0.0, -0.06));
        world.insert_collider(ground, None);
        let mut walls = Vec::new();
        for (x, y) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0_f32)] {
            let wall = ColliderBuilder::cuboid(
                if x == 0.0 { half } else { 0.05 },
                if y == 0.0 { half } else { 0.05 },
                1.0,
            );
            let wall = wall.translation(Vector::new(x * half, y * half, 0.5)).friction(0.2).restitution(0.7);
            walls.push(world.insert_collider(wall, None));
        }
        let body = RigidBodyBuilder::dynamic().ccd_enabled(true).can_sleep(false);
        let (body, shape) = match roller {
            Roller::Ball => (
                body.translation(Vector::new(-0.8, 0.1, 0.6)).linvel(Vector::new(0.7, 0.25, 0.0)),
                ColliderBuilder::ball(RADIUS).density(DENSITIES[0]),
            ),
            // Its axis lies along y, so it rolls along x.
            Roller::Capsule => (
                body.translation(Vector::new(0.0, 0.0, RADIUS + 0.02))
                    .linear_damping(0.2)
                    .angular_damping(0.4),
                ColliderBuilder::capsule_y(HALF_AXIS, RADIUS).density(DENSITIES[1]),
            ),
        };
        let (ball, ball_shape) = world.insert(body, shape.friction(0.4).restitution(0.6));
        Self { world, ball, ball_shape, walls, touched: [false; 2], time: 0.0, kicked: 0, roller }
    }

    /// Advances by one frame, and returns its contacts.
    pub fn step(&mut self) -> Vec<Contact> {
        self.time += self.world.integration_parameters.dt;
        if self.roller == Roller::Ball && self.time > KICK * (self.kicked + 1) as f32 {
            self.kicked += 1;
            let body = &mut self.world.bodies[self.ball];
            let (x, y) = (scatter(self.kicked, 1), scatter(self.kicked, 2));
            let mass = body.mass();
            body.apply_impulse(Vector::new(1.5 * x, 1.5 * y, 1.5) * mass, true);
        }
        let before = self.world.bodies[self.ball].linvel();
        self.world.step();
        let mut found = Vec::new();
        for kind in 0..2 {
            match self.joined(kind, before) {
                Some(contact) => {
                    self.touched[kind] = true;
                    found.push(contact);
                }
                None if self.touched[kind] => {
                    self.touched[kind] = false;
                    found.push(Contact { id: kind as i32 + 1, ends: true, ..Contact::none() });
                }
                None => {}
            }
        }
        found
    }

    /// Acts on a key: `w`, `a`, `s` and `d` push away, to the left, near and to the right; a space or `j` jumps from the floor.
    pub fn press(&mut self, key: char) {
        let push = match key.to_ascii_lowercase() {
            'w' => Vector::new(0.0, PUSH, 0.0),
            's' => Vector::new(0.0, -PUSH, 0.0),
            'a' => Vector::new(-PUSH, 0.0, 0.0),
            'd' => Vector::new(PUSH, 0.0, 0.0),
            ' ' | 'j' if self.touched[0] => Vector::new(0.0, 0.0, JUMP),
            _ => return,
        };
        let body = &mut self.world.bodies[self.ball];
        let mass = body.mass();
        body.apply_impulse(push * mass, true);
    }

    /// All contacts of the ball with the floor (0) or with the walls (1) as one.
    fn joined(&self, kind: usize, before: Vector) -> Option<Contact> {
        let body = &self.world.bodies[self.ball];
        let mut sum = Vector::ZERO;
        for pair in self.world.narrow_phase.contact_pairs() {
            let second = pair.collider2 == self.ball_shape;
            let other = if second { pair.collider1 } else { pair.collider2 };
            if usize::from(self.walls.contains(&other)) != kind {
                continue;
            }
            for manifold in pair.manifolds() {
                for point in &manifold.points {
                    let impulse = point.data.impulse;
                    sum += manifold.data.normal * (if second { impulse } else { -impulse });
                }
            }
        }
        let impulse = sum.length();
        if impulse <= 0.0 {
            return None;
        }
        let towards_ball = sum / impulse;
        let point = match self.roller {
            Roller::Ball => Vector::ZERO,
            // It touches along a line, and on one end where it tilts. Its centre of pressure would leap along the line from frame
            // to frame, which is no motion over the floor.
            Roller::Capsule => {
                let axis = body.rotation() * Vector::Y;
                axis * (-HALF_AXIS * (axis.dot(towards_ball) / TILT).clamp(-1.0, 1.0))
            }
        };
        let point = body.translation() + point - towards_ball * RADIUS;
        // The walls have the greater number, so there the ball is the first body: all turns round.
        let (bodies, sign) = if kind == 0 { ([0, 1], 1.0) } else { ([1, 2], -1.0) };
        let speed = body.linvel();
        // A body that turns about the normal takes its contact point along.
        let turn = towards_ball * body.angvel().dot(towards_ball);
        let speed = speed + turn.cross(point - body.translation());
        let over_floor = speed - towards_ball * speed.dot(towards_ball);
        let slip = body.velocity_at_point(point);
        let travel = if kind == 0 { over_floor } else { over_floor - slip };
        Some(Contact {
            id: kind as i32 + 1,
            bodies,
            point: point.into(),
            normal: (towards_ball * sign).into(),
            impulse,
            velocity: (slip * sign).into(),
            approach: (-before.dot(towards_ball)).max(0.0),
            mass: body.mass(),
            travel: travel.into(),
            ends: false,
        })
    }
}

impl Contact {
    fn none() -> Self {
        let still = [0.0; 3];
        Self {
            id: 0,
            bodies: [0, 1],
            point: still,
            normal: still,
            impulse: 0.0,
            velocity: still,
            approach: 0.0,
            mass: 0.0,
            travel: still,
            ends: true,
        }
    }
}
