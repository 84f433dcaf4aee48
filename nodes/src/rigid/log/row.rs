//! Rows of contact logs, from the columns of several engines or from JSON.

use super::bodies::{Bodies, MAX_BODIES};
use super::columns::{CONTACT, Columns, Field};
use super::error::{LogFault, shorten};
use super::table::{Cells, read_table};
use crate::contact::vector::{Vec3, add, dot, norm, scale, sub};
use crate::core::files::strip_bom;
use serde_json::{Map, Value};

/// Largest number of rows in a log.
pub const MAX_ROWS: usize = 1 << 21;
/// Largest time, s.
pub(super) const MAX_TIME: f64 = 86_400.0;

/// One contact point in one frame, in SI units; body a has the smaller number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Row {
    pub time: f64,
    pub id: Option<u64>,
    pub bodies: [u32; 2],
    pub point: Vec3,
    /// Unit normal from a to b.
    pub normal: Vec3,
    pub force: Option<f64>,
    pub impulse: Option<f64>,
    /// Friction force on b, N.
    pub friction: Option<Vec3>,
    /// Magnitude of the impulse of friction, N s.
    pub friction_impulse: Option<f64>,
    /// Velocity of b relative to a.
    pub velocity: Option<Vec3>,
    pub approach: Option<f64>,
    /// Depth of penetration, negative for a gap.
    pub depth: Option<f64>,
    pub mass: Option<f64>,
    /// Velocities over the surfaces of a and b.
    pub travel: [Option<Vec3>; 2],
}

impl Row {
    /// Swaps the bodies if body a does not have the smaller number.
    fn with_ordered_bodies(mut self) -> Self {
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

/// Normalises a normal of length 0.5 to 2, or returns a message.
fn normalised(normal: Vec3) -> Result<Vec3, String> {
    let length = norm(normal);
    if (0.5..=2.0).contains(&length) {
        return Ok(scale(normal, 1.0 / length));
    }
    Err(format!("the normal has length {length:.3}; one of length 1 is needed"))
}

/// Description of a required column that the header lacks.
fn missing_column(columns: &Columns, poses: bool) -> Option<&'static str> {
    use Field::{BackNx, BackNy, BackNz, BodyA, BodyB, Force, Impulse, NameA, NameB, Nx, Ny, Nz};
    let has = |sets: &[&[Field]]| sets.iter().any(|set| columns.has_all(set));
    let points: [&[Field]; 2] = [
        &[Field::Px, Field::Py, Field::Pz],
        &[Field::OnAx, Field::OnAy, Field::OnAz, Field::OnBx, Field::OnBy, Field::OnBz],
    ];
    let velocities: [&[Field]; 3] = [
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
    } else if !poses && !has(&velocities) {
        Some("the velocity of b relative to a: `vx`, `vy`, `vz`, or poses of the bodies")
    } else {
        None
    }
}

fn body(cells: &Cells<'_>, name: Field, number: Field, bodies: &mut Bodies) -> Result<u32, LogFault> {
    let (name_text, number_text) = (cells.text(name)?, cells.text(number)?);
    let field = if cells.columns.has(name) { name } else { number };
    let own_number = number_text.and_then(|t| t.parse().ok());
    let Some(text) = name_text.or(number_text) else {
        return Err(cells.fault(field, "nothing is there; a name or a number is needed"));
    };
    // A name can be a number.
    let own_number = own_number.or_else(|| text.parse().ok());
    let number = bodies.number(text, own_number);
    number.ok_or_else(|| cells.fault(field, format!("more than {MAX_BODIES} bodies are named")))
}

/// Friction on b from the columns of Bullet, which are the friction on a along two directions.
fn bullet_friction(cells: &Cells<'_>) -> Result<Option<Vec3>, LogFault> {
    let component = |size, axes| -> Result<Option<Vec3>, LogFault> {
        let force = cells.optional_number(size)?.zip(cells.optional_vector(axes)?);
        Ok(force.map(|(size, axis)| scale(axis, size)))
    };
    let first = component(Field::Friction1, [Field::F1x, Field::F1y, Field::F1z])?;
    let second = component(Field::Friction2, [Field::F2x, Field::F2y, Field::F2z])?;
    Ok(first.map(|f| scale(add(f, second.unwrap_or_default()), -1.0)))
}

fn velocity(cells: &Cells<'_>, normal: Vec3, friction: Option<Vec3>) -> Result<Option<Vec3>, LogFault> {
    if let Some(v) = cells.optional_vector([Field::Vx, Field::Vy, Field::Vz])? {
        return Ok(Some(v));
    }
    let Some(separating) = cells.optional_number(Field::NormalSpeed)? else { return Ok(None) };
    let normal_velocity = scale(normal, separating);
    if let Some(slip) = cells.optional_vector([Field::SlipX, Field::SlipY, Field::SlipZ])? {
        return Ok(Some(add(normal_velocity, slip)));
    }
    // Only the magnitude of the slip is known; friction on b is opposite to it.
    let Some(slip) = cells.optional_number(Field::SlipSpeed)? else { return Ok(None) };
    let Some(friction) = friction.filter(|f| norm(*f) > 1e-9) else { return Ok(None) };
    Ok(Some(sub(normal_velocity, scale(friction, slip / norm(friction)))))
}

fn optional_non_negative(cells: &Cells<'_>, field: Field) -> Result<Option<f64>, LogFault> {
    let number = cells.optional_number(field)?;
    if let Some(x) = number.filter(|x| *x < 0.0) {
        return Err(cells.fault(field, format!("{x} is there; a number from 0 on is needed")));
    }
    Ok(number)
}

fn from_cells(cells: &Cells<'_>, bodies: &mut Bodies) -> Result<Row, LogFault> {
    let time = cells.number(Field::Time)?;
    if !(0.0..=MAX_TIME).contains(&time) {
        return Err(cells.fault(Field::Time, format!("{time} s is there; 0 to {MAX_TIME} s are needed")));
    }
    let pair =
        [body(cells, Field::NameA, Field::BodyA, bodies)?, body(cells, Field::NameB, Field::BodyB, bodies)?];
    // Bullet's normal points from b to a.
    let is_reversed = cells.columns.has(Field::BackNx);
    let field = if is_reversed { Field::BackNx } else { Field::Nx };
    let normal = if is_reversed {
        scale(cells.vector([Field::BackNx, Field::BackNy, Field::BackNz])?, -1.0)
    } else {
        cells.vector([Field::Nx, Field::Ny, Field::Nz])?
    };
    let normal = normalised(normal).map_err(|message| cells.fault(field, message))?;
    let point = if cells.columns.has(Field::Px) {
        cells.vector([Field::Px, Field::Py, Field::Pz])?
    } else {
        let on_a = cells.vector([Field::OnAx, Field::OnAy, Field::OnAz])?;
        scale(add(on_a, cells.vector([Field::OnBx, Field::OnBy, Field::OnBz])?), 0.5)
    };
    let mut friction = cells.optional_vector([Field::Fx, Field::Fy, Field::Fz])?;
    if friction.is_none() {
        friction = bullet_friction(cells)?;
    }
    let velocity = velocity(cells, normal, friction)?;
    if friction.is_none()
        && let Some((first, second)) =
            cells.optional_number(Field::Tangent1)?.zip(cells.optional_number(Field::Tangent2)?)
    {
        friction = velocity.and_then(|v| friction_against(v, normal, first.hypot(second)));
    }
    let id = match cells.text(Field::Id)? {
        None => None,
        Some(text) => Some(text.parse().map_err(|_| {
            cells
                .fault(Field::Id, format!("{:?} is there; a whole number from 0 on is needed", shorten(text)))
        })?),
    };
    let depth = cells.optional_number(Field::Depth)?;
    let max_approach = cells.optional_number(Field::FastestIn)?.map(|v| (-v).max(0.0));
    let row = Row {
        time,
        id,
        bodies: pair,
        point,
        normal,
        force: optional_non_negative(cells, Field::Force)?,
        impulse: optional_non_negative(cells, Field::Impulse)?,
        friction,
        friction_impulse: optional_non_negative(cells, Field::TangentImpulse)?,
        velocity,
        approach: optional_non_negative(cells, Field::Approach)?.or(max_approach),
        depth: depth.or(cells.optional_number(Field::Gap)?.map(|gap| -gap)),
        mass: optional_non_negative(cells, Field::Mass)?,
        travel: [
            cells.optional_vector([Field::TravelAx, Field::TravelAy, Field::TravelAz])?,
            cells.optional_vector([Field::TravelBx, Field::TravelBy, Field::TravelBz])?,
        ],
    };
    checked(row).map_err(|message| LogFault::new(cells.line, message))
}

/// Friction force of a magnitude, opposite to the slip; `None` without slip.
pub(super) fn friction_against(velocity: Vec3, normal: Vec3, magnitude: f64) -> Option<Vec3> {
    let slip = sub(velocity, scale(normal, dot(velocity, normal)));
    let speed = norm(slip);
    (speed > 1e-9).then(|| scale(slip, -magnitude / speed))
}

fn checked(row: Row) -> Result<Row, String> {
    if row.bodies[0] == row.bodies[1] {
        return Err(format!("body {} touches itself; two bodies are needed", row.bodies[0]));
    }
    if row.force.is_none() && row.impulse.is_none() {
        return Err("how hard do they press? `force` (N) or `impulse` (N s) is needed".into());
    }
    Ok(row.with_ordered_bodies())
}

/// Keys of a contact as JSON. `contact`, the channel of a line that `foley live` reads, has no meaning in a log.
pub const KEYS: [&str; 17] = [
    "contact", "time_s", "id", "a", "b", "point", "normal", "force", "impulse", "friction", "velocity",
    "approach", "depth", "mass", "travel_a", "travel_b", "step",
];

/// Converts one contact from JSON.
///
/// # Errors
/// The key and a message.
fn from_json(object: &Map<String, Value>, bodies: &mut Bodies) -> Result<Row, (String, String)> {
    if let Some(key) = object.keys().find(|key| !KEYS.contains(&key.as_str())) {
        return Err((key.clone(), format!("there is no such key; known are {}", KEYS.join(", "))));
    }
    let wrong = |key: &str, expected: &str| {
        let found = object.get(key).map_or("nothing".into(), Value::to_string);
        (key.to_owned(), format!("{} is there; {expected} needed", shorten(&found)))
    };
    let number = |key: &str| match object.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(value) => {
            let x = value.as_f64().filter(|x| x.abs() <= 1e12);
            x.map(Some).ok_or_else(|| wrong(key, "a finite number is"))
        }
    };
    let non_negative = |key: &str| match number(key)? {
        Some(x) if x < 0.0 => Err(wrong(key, "a number from 0 on is")),
        x => Ok(x),
    };
    let vector = |key: &str| match object.get(key) {
        None | Some(Value::Null) => Ok(None),
        Some(value) => {
            let list: Option<Vec<f64>> =
                value.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
            let vector = list.and_then(|list| <Vec3>::try_from(list).ok());
            let vector = vector.filter(|v| v.iter().all(|x| x.abs() <= 1e12));
            vector.map(Some).ok_or_else(|| wrong(key, "a list of three numbers is"))
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
    let required_vector = |key: &str| vector(key)?.ok_or_else(|| wrong(key, "a list of three numbers is"));
    let time = number("time_s")?.filter(|t| (0.0..=MAX_TIME).contains(t));
    let time = time.ok_or_else(|| wrong("time_s", &format!("seconds from 0 to {MAX_TIME} are")))?;
    let id = match object.get("id") {
        None | Some(Value::Null) => None,
        Some(value) => Some(value.as_u64().ok_or_else(|| wrong("id", "a whole number from 0 on is"))?),
    };
    let row = Row {
        time,
        id,
        bodies: pair,
        point: required_vector("point")?,
        normal: normalised(required_vector("normal")?).map_err(|message| ("normal".to_owned(), message))?,
        force: non_negative("force")?,
        impulse: non_negative("impulse")?,
        friction: vector("friction")?,
        friction_impulse: None,
        velocity: vector("velocity")?,
        approach: non_negative("approach")?,
        depth: number("depth")?,
        mass: non_negative("mass")?,
        travel: [vector("travel_a")?, vector("travel_b")?],
    };
    // Frame intervals follow from the times of the log.
    non_negative("step")?;
    checked(row).map_err(|message| ("force".to_owned(), message))
}

/// Reads all rows of a CSV file with a header or of JSON lines.
pub(super) fn read_rows(bytes: &[u8], poses: bool, bodies: &mut Bodies) -> Result<Vec<Row>, LogFault> {
    let bytes = strip_bom(bytes);
    let mut rows: Vec<Row> = Vec::new();
    let first_byte = bytes.iter().find(|b| !b.is_ascii_whitespace());
    let time_column = if first_byte == Some(&b'{') { "time_s" } else { "time" };
    let mut push = |line: u64, row: Row| {
        if let Some(before) = rows.last().filter(|last| row.time < last.time) {
            let message =
                format!("time goes back from {} to {} s; rows must be in order", before.time, row.time);
            return Err(LogFault::at(line, time_column, message));
        }
        if rows.len() == MAX_ROWS {
            return Err(LogFault::new(line, format!("at most {MAX_ROWS} rows are read")));
        }
        rows.push(row);
        Ok(())
    };
    if first_byte == Some(&b'[') {
        return Err(LogFault::new(
            1,
            "a JSON list begins here; one object in each line is needed, without brackets around them",
        ));
    }
    if first_byte == Some(&b'{') {
        for (k, text) in bytes.split(|b| *b == b'\n').enumerate() {
            let line = k as u64 + 1;
            if text.trim_ascii().is_empty() {
                continue;
            }
            let object: Map<String, Value> = serde_json::from_slice(text)
                .map_err(|e| LogFault::new(line, format!("this is not a JSON object on one line: {e}")))?;
            let row = from_json(&object, bodies).map_err(|(key, m)| LogFault::at(line, &key, m))?;
            if row.velocity.is_none() && !poses {
                let message = "nothing is there; three numbers in m/s, or poses of the bodies, are needed";
                return Err(LogFault::at(line, "velocity", message));
            }
            push(line, row)?;
        }
    } else {
        let check = |columns: &Columns, line: u64| match missing_column(columns, poses) {
            None => Ok(()),
            Some(what) => Err(LogFault::new(line, format!("there is no column for {what}"))),
        };
        read_table(bytes, CONTACT, check, |cells| push(cells.line, from_cells(cells, bodies)?))?;
    }
    if rows.is_empty() {
        return Err(LogFault::new(1, "there is no contact under the header"));
    }
    Ok(rows)
}
