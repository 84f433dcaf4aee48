//! Columns of contact logs: their names in several engines, meanings and units.

/// Meaning of a column; the three components of a vector are in the order x, y, z.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub(super) enum Field {
    Time,
    Id,
    BodyA,
    BodyB,
    NameA,
    NameB,
    Px,
    Py,
    Pz,
    OnAx,
    OnAy,
    OnAz,
    OnBx,
    OnBy,
    OnBz,
    Nx,
    Ny,
    Nz,
    BackNx,
    BackNy,
    BackNz,
    Force,
    Impulse,
    Fx,
    Fy,
    Fz,
    Tangent1,
    Tangent2,
    TangentImpulse,
    Friction1,
    F1x,
    F1y,
    F1z,
    Friction2,
    F2x,
    F2y,
    F2z,
    Vx,
    Vy,
    Vz,
    NormalSpeed,
    SlipX,
    SlipY,
    SlipZ,
    SlipSpeed,
    Approach,
    FastestIn,
    Depth,
    Gap,
    Mass,
    TravelAx,
    TravelAy,
    TravelAz,
    TravelBx,
    TravelBy,
    TravelBz,
    Qw,
    Qx,
    Qy,
    Qz,
    Wx,
    Wy,
    Wz,
    /// Ignored.
    Other,
}

/// Quantity of a column, which determines the unit suffixes of its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    Second,
    Metre,
    Speed,
    Force,
    Impulse,
    Mass,
    None,
}

impl Unit {
    /// Suffixes with their factors to SI units.
    fn suffixes(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Second => &[("_s", 1.0), ("_ms", 1e-3)],
            Self::Metre => &[("_m", 1.0), ("_cm", 1e-2), ("_mm", 1e-3)],
            Self::Speed => &[("_m_s", 1.0), ("_cm_s", 1e-2), ("_mm_s", 1e-3)],
            Self::Force => &[("_n", 1.0), ("_mn", 1e-3), ("_kn", 1e3)],
            Self::Impulse => &[("_ns", 1.0), ("_mns", 1e-3)],
            Self::Mass => &[("_kg", 1.0), ("_g", 1e-3)],
            Self::None => &[],
        }
    }
}

type Name = (&'static str, Field, Unit);

/// Columns of contact logs: those of foley, then those of MuJoCo logs and of Bullet manifolds.
pub(super) const CONTACT: &[Name] = &[
    ("time", Field::Time, Unit::Second),
    ("id", Field::Id, Unit::None),
    ("a", Field::NameA, Unit::None),
    ("b", Field::NameB, Unit::None),
    ("px", Field::Px, Unit::Metre),
    ("py", Field::Py, Unit::Metre),
    ("pz", Field::Pz, Unit::Metre),
    ("nx", Field::Nx, Unit::None),
    ("ny", Field::Ny, Unit::None),
    ("nz", Field::Nz, Unit::None),
    ("force", Field::Force, Unit::Force),
    ("impulse", Field::Impulse, Unit::Impulse),
    ("fx", Field::Fx, Unit::Force),
    ("fy", Field::Fy, Unit::Force),
    ("fz", Field::Fz, Unit::Force),
    ("vx", Field::Vx, Unit::Speed),
    ("vy", Field::Vy, Unit::Speed),
    ("vz", Field::Vz, Unit::Speed),
    ("approach", Field::Approach, Unit::Speed),
    ("depth", Field::Depth, Unit::Metre),
    ("mass", Field::Mass, Unit::Mass),
    ("tax", Field::TravelAx, Unit::Speed),
    ("tay", Field::TravelAy, Unit::Speed),
    ("taz", Field::TravelAz, Unit::Speed),
    ("tbx", Field::TravelBx, Unit::Speed),
    ("tby", Field::TravelBy, Unit::Speed),
    ("tbz", Field::TravelBz, Unit::Speed),
    ("comment", Field::Other, Unit::None),
    ("body1", Field::BodyA, Unit::None),
    ("body2", Field::BodyB, Unit::None),
    ("name1", Field::NameA, Unit::None),
    ("name2", Field::NameB, Unit::None),
    ("force_normal", Field::Force, Unit::Force),
    ("force_tangent1", Field::Tangent1, Unit::Force),
    ("force_tangent2", Field::Tangent2, Unit::Force),
    ("impulse_normal", Field::Impulse, Unit::Impulse),
    ("impulse_tangent", Field::TangentImpulse, Unit::Impulse),
    ("vel_normal", Field::NormalSpeed, Unit::Speed),
    ("vel_tangent", Field::SlipSpeed, Unit::Speed),
    ("vt_x", Field::SlipX, Unit::Speed),
    ("vt_y", Field::SlipY, Unit::Speed),
    ("vt_z", Field::SlipZ, Unit::Speed),
    ("vel_normal_in", Field::FastestIn, Unit::Speed),
    ("step", Field::Other, Unit::None),
    ("bodyA", Field::BodyA, Unit::None),
    ("bodyB", Field::BodyB, Unit::None),
    ("nameA", Field::NameA, Unit::None),
    ("nameB", Field::NameB, Unit::None),
    ("posA_x", Field::OnAx, Unit::Metre),
    ("posA_y", Field::OnAy, Unit::Metre),
    ("posA_z", Field::OnAz, Unit::Metre),
    ("posB_x", Field::OnBx, Unit::Metre),
    ("posB_y", Field::OnBy, Unit::Metre),
    ("posB_z", Field::OnBz, Unit::Metre),
    ("normalOnB_x", Field::BackNx, Unit::None),
    ("normalOnB_y", Field::BackNy, Unit::None),
    ("normalOnB_z", Field::BackNz, Unit::None),
    ("distance", Field::Gap, Unit::Metre),
    ("normalForce", Field::Force, Unit::Force),
    ("friction1", Field::Friction1, Unit::Force),
    ("f1_x", Field::F1x, Unit::None),
    ("f1_y", Field::F1y, Unit::None),
    ("f1_z", Field::F1z, Unit::None),
    ("friction2", Field::Friction2, Unit::Force),
    ("f2_x", Field::F2x, Unit::None),
    ("f2_y", Field::F2y, Unit::None),
    ("f2_z", Field::F2z, Unit::None),
    ("relvel_n", Field::NormalSpeed, Unit::Speed),
    ("relvel_t", Field::SlipSpeed, Unit::Speed),
];

/// Columns of the poses of bodies.
pub(super) const POSES: &[Name] = &[
    ("time", Field::Time, Unit::Second),
    ("body", Field::BodyA, Unit::None),
    ("name", Field::NameA, Unit::None),
    ("px", Field::Px, Unit::Metre),
    ("py", Field::Py, Unit::Metre),
    ("pz", Field::Pz, Unit::Metre),
    ("qw", Field::Qw, Unit::None),
    ("qx", Field::Qx, Unit::None),
    ("qy", Field::Qy, Unit::None),
    ("qz", Field::Qz, Unit::None),
    ("vx", Field::Vx, Unit::Speed),
    ("vy", Field::Vy, Unit::Speed),
    ("vz", Field::Vz, Unit::Speed),
    ("wx", Field::Wx, Unit::None),
    ("wy", Field::Wy, Unit::None),
    ("wz", Field::Wz, Unit::None),
    ("comment", Field::Other, Unit::None),
];

/// Field of a column's name, and the factor of its numbers to SI units.
fn lookup(table: &[Name], name: &str) -> Option<(Field, f64)> {
    let find = |name: &str| table.iter().find(|(known, ..)| *known == name);
    if let Some((_, field, _)) = find(name) {
        return Some((*field, 1.0));
    }
    table.iter().find_map(|(known, field, unit)| {
        let suffix = name.strip_prefix(known)?;
        let (_, factor) = unit.suffixes().iter().find(|(s, _)| *s == suffix)?;
        Some((*field, *factor))
    })
}

/// Column of each field.
#[derive(Clone, Debug)]
pub(super) struct Columns {
    /// Index of a column and factor of its numbers, for each field.
    indices: [Option<(usize, f64)>; Field::Other as usize],
    pub names: Vec<String>,
}

impl Columns {
    /// Reads a header.
    ///
    /// # Errors
    /// A column that is not known, or a field with two columns: the name of the column and a message.
    pub fn of(table: &[Name], names: Vec<String>) -> Result<Self, (String, String)> {
        if let [all] = &names[..]
            && let Some(separator) = [';', '\t'].into_iter().find(|separator| all.contains(*separator))
        {
            let first = all.split(separator).next().unwrap_or_default().to_owned();
            return Err((
                first,
                format!("columns are separated by {separator:?}; commas are needed, and points in numbers"),
            ));
        }
        let mut indices = [None; Field::Other as usize];
        for (k, name) in names.iter().enumerate() {
            let Some((field, factor)) = lookup(table, name) else {
                let known: Vec<&str> = table.iter().map(|(known, ..)| *known).collect();
                return Err((
                    name.clone(),
                    format!("there is no such column; known are {}", known.join(", ")),
                ));
            };
            if let Some(index) = indices.get_mut(field as usize) {
                if let Some((other, _)) = *index {
                    let other: &str = names.get(other).map_or("", String::as_str);
                    return Err((
                        name.clone(),
                        format!("it has the same meaning as column `{other}`; keep one of them"),
                    ));
                }
                *index = Some((k, factor));
            }
        }
        Ok(Self { indices, names })
    }

    /// Index of the column of a field, and the factor of its numbers.
    pub fn find(&self, field: Field) -> Option<(usize, f64)> {
        self.indices.get(field as usize).copied().flatten()
    }

    /// Returns true if there is a column of the field.
    pub fn has(&self, field: Field) -> bool {
        self.find(field).is_some()
    }

    /// Returns true if there are columns of all fields.
    pub fn has_all(&self, fields: &[Field]) -> bool {
        fields.iter().all(|f| self.has(*f))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Result<Columns, (String, String)> {
        Columns::of(CONTACT, text.split(',').map(str::to_owned).collect())
    }

    #[test]
    fn suffixes_give_the_unit_of_a_column() {
        let columns = header("time_ms,px_mm,force_kn,vx_cm_s,impulse_mns,mass_g").unwrap();
        let factor = |f| columns.find(f).unwrap().1;
        assert_eq!([factor(Field::Time), factor(Field::Px), factor(Field::Force)], [1e-3, 1e-3, 1e3]);
        assert_eq!([factor(Field::Vx), factor(Field::Impulse), factor(Field::Mass)], [1e-2, 1e-3, 1e-3]);
        assert_eq!(header("time,px_kg").unwrap_err().0, "px_kg");
    }

    #[test]
    fn other_separators_are_named() {
        for separator in [';', '\t'] {
            let (name, message) = header(&format!("time{separator}a{separator}b")).unwrap_err();
            assert!(name == "time" && message.contains(&format!("{separator:?}")), "{name}: {message}");
            assert!(message.contains("commas"), "{message}");
        }
    }

    #[test]
    fn two_columns_of_one_field_are_rejected() {
        let (name, message) = header("time,impulse,impulse_normal").unwrap_err();
        assert!(name == "impulse_normal" && message.contains("`impulse`"), "{message}");
    }

    #[test]
    fn the_book_names_every_column() {
        let book = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/src/contacts.md");
        let book = std::fs::read_to_string(book).unwrap();
        let is_named = |name: &str| book.contains(&format!("`{name}`"));
        for (name, ..) in CONTACT.iter().chain(POSES) {
            // Of columns that differ by axis or number only, the first is enough.
            let stem = &name[..name.len() - 1];
            let first = |end: &&str| is_named(&format!("{stem}{end}"));
            let first_is_named = name.ends_with(['y', 'z', '2']) && ["x", "1"].iter().any(first);
            assert!(is_named(name) || first_is_named, "`{name}` is not in the book");
        }
    }

    #[test]
    fn every_name_is_found_in_its_table() {
        for (name, field, _) in CONTACT.iter().chain(POSES) {
            let table = if CONTACT.iter().any(|(n, ..)| n == name) { CONTACT } else { POSES };
            assert_eq!(lookup(table, name), Some((*field, 1.0)), "{name}");
        }
    }
}
