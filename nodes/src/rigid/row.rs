//! One row of a contact log, whatever engine wrote it.

use super::bodies::{Bodies, MAX_BODIES};
use super::columns::{CONTACT, Columns, Field};
use super::error::{LogFault, shown};
use super::table::{Cells, read_table};
use crate::contact::vector::{Vec3, add, dot, norm, scale, sub};
use crate::core::files::strip_bom;
use serde_json::{Map, Value};

/// Most rows that a log may have.
pub const MAX_ROWS: usize = 1 << 21;
/// Latest time, s.
pub(super) const LATEST: f64 = 86_400.0;

/// One contact point in one frame, in SI units; body a has the smaller number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Row {
    pub time: f64,
    pub id: Option<u64>,
    pub bodies: [u32; 2],
    pub point: Vec3,
    /// From a to b, of length 1.
    pub normal: Vec3,
    pub force: Option<f64>,
    pub impulse: Option<f64>,
    /// On b, N.
    pub friction: Option<Vec3>,
    /// The same as an impulse without direction, N s.
    pub drag: Option<f64>,
    /// Of b relative to a.
    pub velocity: Option<Vec3>,
    pub approach: Option<f64>,
    pub mass: Option<f64>,
    pub travel: [Option<Vec3>; 2],
    /// Seconds since the frame before, where the sender tells.
    pub step: Option<f64>,
}

impl Row {
    /// Lets body a be the one with the smaller number.
    fn ordered(mut self) -> Self {
        if self.bodies[0] > self.bodies[1] {
            self.bodies.swap(0, 1);
            self.travel.swap(0, 1);
            self.normal = scale(self.normal, -1.0);
            self.velocity = self.velocity.map(|v| scale(v, -1.0));
            self.friction = self.friction.map(|f| scale(f, -1.0));
        }
        self
    }
}

/// Of length 1, or what is wrong.
fn unit(normal: Vec3) -> Result<Vec3, String> {
    let length = norm(normal);
    if (0.5..=2.0).contains(&length) {
        return Ok(scale(normal, 1.0 / length));
    }
    Err(format!("the normal has length {length:.3}; one of length 1 is needed"))
}

/// What is needed of the header, and is not there.
fn missing(columns: &Columns, poses: bool) -> Option<&'static str> {
    use Field::{BackNx, BackNy, BackNz, BodyA, BodyB, Force, Impulse, NameA, NameB, Nx, Ny, Nz};
    let has = |sets: &[&[Field]]| sets.iter().any(|set| columns.all(set));
    let points: [&[Field]; 2] = [
        &[Field::Px, Field::Py, Field::Pz],
        &[Field::OnAx, Field::OnAy, Field::OnAz, Field::OnBx, Field::OnBy, Field::OnBz],
    ];
    let speeds: [&[Field]; 3] = [
        &[Field::Vx, Field::Vy, Field::Vz],
        &[Field::NormalSpeed, Field::SlipX, Field::SlipY, Field::SlipZ],
        &[Field::NormalSpeed, Field::SlipSpeed, Field::Friction1, Field::F1x, Field::F1y, Field::F1z],
    ];
    if !columns.has(Field::Time) {
        Some("`time`, in seconds")
    } else if !has(&[&[NameA], &[BodyA]]) || !has(&[&[NameB], &[BodyB]]) {
        Some("the two bodies: `a` and `b`")
    } else if !has(&points) {
        Some("where the contact is: `px`, `py`, `pz`")
    } else if !has(&[&[Nx, Ny, Nz], &[BackNx, BackNy, BackNz]]) {
        Some("the normal from a to b: `nx`, `ny`, `nz`")
    } else if !has(&[&[Force], &[Impulse]]) {
        Some("how hard they press: `force` in N, or `impulse` in N s")
    } else if !poses && !has(&speeds) {
        Some("the velocity of b relative to a: `vx`, `vy`, `vz`, or poses of the bodies")
    } else {
        None
    }
}

fn body(cells: &Cells<'_>, name: Field, number: Field, bodies: &mut Bodies) -> Result<u32, LogFault> {
    let (named, own) = (cells.text(name)?, cells.text(number)?);
    let field = if cells.columns.has(name) { name } else { number };
    let own_number = own.and_then(|t| t.parse().ok());
    let Some(text) = named.or(own) else {
        return Err(cells.fault(field, "nothing is there; a name or a number is needed"));
    };
    // A name that is a number counts as one.
    let own_number = own_number.or_else(|| text.parse().ok());
    let number = bodies.number(text, own_number);
    number.ok_or_else(|| cells.fault(field, format!("more than {MAX_BODIES} bodies are named")))
}

/// Friction as Bullet tells it: on a, along two directions.
fn bullet_friction(cells: &Cells<'_>) -> Result<Option<Vec3>, LogFault> {
    let along = |size, axes| -> Result<Option<Vec3>, LogFault> {
        Ok(cells.maybe(size)?.zip(cells.maybe_vector(axes)?).map(|(size, axis)| scale(axis, size)))
    };
    let first = along(Field::Friction1, [Field::F1x, Field::F1y, Field::F1z])?;
    let second = along(Field::Friction2, [Field::F2x, Field::F2y, Field::F2z])?;
    Ok(first.map(|f| scale(add(f, second.unwrap_or_default()), -1.0)))
}

fn velocity(cells: &Cells<'_>, normal: Vec3, friction: Option<Vec3>) -> Result<Option<Vec3>, LogFault> {
    if let Some(v) = cells.maybe_vector([Field::Vx, Field::Vy, Field::Vz])? {
        return Ok(Some(v));
    }
    let Some(separating) = cells.maybe(Field::NormalSpeed)? else { return Ok(None) };
    let along = scale(normal, separating);
    if let Some(slip) = cells.maybe_vector([Field::SlipX, Field::SlipY, Field::SlipZ])? {
        return Ok(Some(add(along, slip)));
    }
    // Friction on b points against its slip, which is told by its size only.
    let Some(slip) = cells.maybe(Field::SlipSpeed)? else { return Ok(None) };
    let Some(against) = friction.filter(|f| norm(*f) > 1e-9) else { return Ok(None) };
    Ok(Some(sub(along, scale(against, slip / norm(against)))))
}

fn positive(cells: &Cells<'_>, field: Field) -> Result<Option<f64>, LogFault> {
    let number = cells.maybe(field)?;
    if let Some(x) = number.filter(|x| *x < 0.0) {
        return Err(cells.fault(field, format!("{x} is there; a number from 0 on is needed")));
    }
    Ok(number)
}

fn from_cells(cells: &Cells<'_>, bodies: &mut Bodies) -> Result<Row, LogFault> {
    let time = cells.number(Field::Time)?;
    if !(0.0..=LATEST).contains(&time) {
        return Err(cells.fault(Field::Time, format!("{time} s is there; 0 to {LATEST} s are needed")));
    }
    let pair =
        [body(cells, Field::NameA, Field::BodyA, bodies)?, body(cells, Field::NameB, Field::BodyB, bodies)?];
    let back = cells.columns.has(Field::BackNx);
    let field = if back { Field::BackNx } else { Field::Nx };
    let normal = if back {
        scale(cells.vector([Field::BackNx, Field::BackNy, Field::BackNz])?, -1.0)
    } else {
        cells.vector([Field::Nx, Field::Ny, Field::Nz])?
    };
    let normal = unit(normal).map_err(|message| cells.fault(field, message))?;
    let point = if cells.columns.has(Field::Px) {
        cells.vector([Field::Px, Field::Py, Field::Pz])?
    } else {
        let on_a = cells.vector([Field::OnAx, Field::OnAy, Field::OnAz])?;
        scale(add(on_a, cells.vector([Field::OnBx, Field::OnBy, Field::OnBz])?), 0.5)
    };
    let mut friction = cells.maybe_vector([Field::Fx, Field::Fy, Field::Fz])?;
    if friction.is_none() {
        friction = bullet_friction(cells)?;
    }
    let velocity = velocity(cells, normal, friction)?;
    if friction.is_none()
        && let Some((one, other)) = cells.maybe(Field::Tangent1)?.zip(cells.maybe(Field::Tangent2)?)
    {
        friction = velocity.and_then(|v| against(v, normal, one.hypot(other)));
    }
    let id = match cells.text(Field::Id)? {
        None => None,
        Some(text) => Some(text.parse().map_err(|_| {
            cells.fault(Field::Id, format!("{:?} is there; a whole number from 0 on is needed", shown(text)))
        })?),
    };
    let fastest_in = cells.maybe(Field::FastestIn)?.map(|v| (-v).max(0.0));
    let row = Row {
        time,
        id,
        bodies: pair,
        point,
        normal,
        force: positive(cells, Field::Force)?,
        impulse: positive(cells, Field::Impulse)?,
        friction,
        drag: positive(cells, Field::TangentImpulse)?,
        velocity,
        approach: positive(cells, Field::Approach)?.or(fastest_in),
        mass: positive(cells, Field::Mass)?,
        travel: [
            cells.maybe_vector([Field::TravelAx, Field::TravelAy, Field::TravelAz])?,
            cells.maybe_vector([Field::TravelBx, Field::TravelBy, Field::TravelBz])?,
        ],
        step: None,
    };
    finished(row).map_err(|message| LogFault::new(cells.line, message))
}

/// A force of a size against a slip.
pub(super) fn against(velocity: Vec3, normal: Vec3, size: f64) -> Option<Vec3> {
    let slip = sub(velocity, scale(normal, dot(velocity, normal)));
    let speed = norm(slip);
    (speed > 1e-9).then(|| scale(slip, -size / speed))
}

fn finished(row: Row) -> Result<Row, String> {
    if row.bodies[0] == row.bodies[1] {
        return Err(format!("body {} touches itself; two bodies are needed", row.bodies[0]));
    }
    if row.force.is_none() && row.impulse.is_none() {
        return Err("how hard do they press? `force` (N) or `impulse` (N s) is needed".into());
    }
    Ok(row.ordered())
}

/// Keys of a contact as JSON.
pub const KEYS: [&str; 15] = [
    "time_s", "id", "a", "b", "point", "normal", "force", "impulse", "friction", "velocity", "approach",
    "mass", "travel_a", "travel_b", "step",
];

/// One contact as a JSON object.
///
/// # Errors
/// The key where there is one, and what would be right.
pub(super) fn from_json(
    object: &Map<String, Value>,
    time: Option<f64>,
    bodies: &mut Bodies,
) -> Result<Row, (String, String)> {
    if let Some(key) = object.keys().find(|key| !KEYS.contains(&key.as_str())) {
        return Err((key.clone(), format!("there is no such key; known are {}", KEYS.join(", "))));
    }
    let wrong = |key: &str, need: &str| {
        let found = object.get(key).map_or("nothing".into(), Value::to_string);
        (key.to_owned(), format!("{} is there; {need} needed", shown(&found)))
    };
    let maybe = |key: &str| match object.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(value) => {
            let x = value.as_f64().filter(|x| x.abs() <= 1e12);
            x.map(Some).ok_or_else(|| wrong(key, "a finite number is"))
        }
    };
    let positive = |key: &str| match maybe(key)? {
        Some(x) if x < 0.0 => Err(wrong(key, "a number from 0 on is")),
        x => Ok(x),
    };
    let vector = |key: &str| match object.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(value) => {
            let list: Option<Vec<f64>> =
                value.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
            let three = list.and_then(|list| <Vec3>::try_from(list).ok());
            let three = three.filter(|v| v.iter().all(|x| x.abs() <= 1e12));
            three.map(Some).ok_or_else(|| wrong(key, "a list of three numbers is"))
        }
    };
    let mut body = |key: &str| match object.get(key) {
        Some(Value::String(name)) => bodies.number(name, name.parse().ok()),
        Some(value) => value.as_u64().and_then(|n| u32::try_from(n).ok()),
        None => None,
    };
    let pair = [
        body("a").ok_or_else(|| wrong("a", "a body's name or number is"))?,
        body("b").ok_or_else(|| wrong("b", "a body's name or number is"))?,
    ];
    let need = |key: &str| vector(key)?.ok_or_else(|| wrong(key, "a list of three numbers is"));
    let time = match time {
        Some(time) => time,
        None => maybe("time_s")?
            .filter(|t| (0.0..=LATEST).contains(t))
            .ok_or_else(|| wrong("time_s", &format!("seconds from 0 to {LATEST} are")))?,
    };
    let id = match object.get("id") {
        None | Some(Value::Null) => None,
        Some(value) => Some(value.as_u64().ok_or_else(|| wrong("id", "a whole number from 0 on is"))?),
    };
    let row = Row {
        time,
        id,
        bodies: pair,
        point: need("point")?,
        normal: unit(need("normal")?).map_err(|message| ("normal".to_owned(), message))?,
        force: positive("force")?,
        impulse: positive("impulse")?,
        friction: vector("friction")?,
        drag: None,
        velocity: vector("velocity")?,
        approach: positive("approach")?,
        mass: positive("mass")?,
        travel: [vector("travel_a")?, vector("travel_b")?],
        step: positive("step")?,
    };
    finished(row).map_err(|message| ("force".to_owned(), message))
}

/// Reads all rows: CSV under a header, or JSON lines.
pub(super) fn read_rows(bytes: &[u8], poses: bool, bodies: &mut Bodies) -> Result<Vec<Row>, LogFault> {
    let bytes = strip_bom(bytes);
    let mut rows: Vec<Row> = Vec::new();
    let begin = bytes.iter().find(|b| !b.is_ascii_whitespace());
    let clock = if begin == Some(&b'{') { "time_s" } else { "time" };
    let mut take = |line: u64, row: Row| {
        if let Some(before) = rows.last().filter(|last| row.time < last.time) {
            let message =
                format!("time goes back from {} to {} s; rows stand in order", before.time, row.time);
            return Err(LogFault::at(line, clock, message));
        }
        if rows.len() == MAX_ROWS {
            return Err(LogFault::new(line, format!("at most {MAX_ROWS} rows are read")));
        }
        rows.push(row);
        Ok(())
    };
    if begin == Some(&b'[') {
        return Err(LogFault::new(
            1,
            "a JSON list begins here; one object in each line is needed, without brackets around",
        ));
    }
    if begin == Some(&b'{') {
        for (k, text) in bytes.split(|b| *b == b'\n').enumerate() {
            let line = k as u64 + 1;
            if text.trim_ascii().is_empty() {
                continue;
            }
            let object: Map<String, Value> = serde_json::from_slice(text)
                .map_err(|e| LogFault::new(line, format!("this is no JSON object on one line: {e}")))?;
            let row = from_json(&object, None, bodies).map_err(|(key, m)| LogFault::at(line, &key, m))?;
            if row.velocity.is_none() && !poses {
                let message = "nothing is there; three numbers in m/s, or poses of the bodies, are needed";
                return Err(LogFault::at(line, "velocity", message));
            }
            take(line, row)?;
        }
    } else {
        let check = |columns: &Columns, line: u64| match missing(columns, poses) {
            None => Ok(()),
            Some(what) => Err(LogFault::new(line, format!("there is no column for {what}"))),
        };
        read_table(bytes, CONTACT, check, |cells| take(cells.line, from_cells(cells, bodies)?))?;
    }
    if rows.is_empty() {
        return Err(LogFault::new(1, "there is no contact under the header"));
    }
    Ok(rows)
}
