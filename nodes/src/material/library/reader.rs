//! Materials as RON that people read and edit.

use super::material::{Elastic, FitOrigin, MATERIAL_VERSION, Material, Uncertainty};
use crate::artefact::text::{RecordWriter, TextError, TextWriter, Version, decode, quote, read};
use crate::artefact::value_file::Artefact;
use crate::core::item::Data;
use crate::core::node::Summary;
use crate::core::random::Rng;
use crate::material::damping::{Convention, DampingModel};
use serde::de::Error;
use serde::{Deserialize, Deserializer};

/// Reads a number in a range, with advice for one in another unit.
fn within<'de, D: Deserializer<'de>>(
    from: D,
    low: f64,
    high: f64,
    unit: &str,
    advice: &str,
) -> Result<f64, D::Error> {
    let x = f64::deserialize(from)?;
    if (low..=high).contains(&x) {
        return Ok(x);
    }
    Err(D::Error::custom(format!("found {x}; a number from {low:e} to {high:e} {unit} is needed{advice}")))
}

macro_rules! quantity {
    ($name:ident, $low:literal, $high:literal, $unit:literal, $advice:literal) => {
        struct $name(f64);
        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                within(from, $low, $high, $unit, $advice).map(Self)
            }
        }
    };
}
quantity!(Young, 1e5, 2e12, "Pa", ": 70 GPa are 70e9");
quantity!(Poisson, -0.999, 0.4999, "", ", and most solids have 0.1 to 0.45");
quantity!(Density, 10.0, 30_000.0, "kg/m^3", ": 2.4 g/cm^3 are 2400");
quantity!(Rate, 0.0, 1e9, "1/s", "");
quantity!(Finite, -1e300, 1e300, "", "");

#[derive(Deserialize)]
#[serde(rename = "Elastic", deny_unknown_fields)]
struct ElasticText {
    young: Young,
    poisson: Poisson,
    density: Density,
    #[serde(default)]
    source: String,
}

#[derive(Deserialize)]
#[serde(rename = "Uncertainty", deny_unknown_fields)]
struct UncertaintyText {
    parameter: String,
    low: Finite,
    high: Finite,
}

#[derive(Deserialize)]
#[serde(rename = "Fit", deny_unknown_fields)]
struct FitText {
    estimator: String,
    points: u32,
    recordings: u32,
    noise: Rate,
    support: Rate,
}

/// A damping model whose parameters are in range.
struct Checked(DampingModel);

impl<'de> Deserialize<'de> for Checked {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let model = DampingModel::deserialize(from)?;
        model.validate().map_err(D::Error::custom)?;
        Ok(Self(model))
    }
}

#[derive(Deserialize)]
#[serde(rename = "Damping", deny_unknown_fields)]
struct DampingText {
    /// Required: a factor of 2 cannot be seen in the numbers.
    convention: Convention,
    model: Checked,
}

#[derive(Deserialize)]
#[serde(rename = "Material", deny_unknown_fields)]
struct FileText {
    #[serde(rename = "version")]
    _version: Version<1, MATERIAL_VERSION>,
    name: String,
    damping: DampingText,
    #[serde(default)]
    elastic: Option<ElasticText>,
    #[serde(default)]
    uncertainty: Vec<UncertaintyText>,
    #[serde(default)]
    fit: Option<FitText>,
    #[serde(default)]
    source: String,
    #[serde(default)]
    licence: String,
}

/// Twice a model: a file in the convention of decay rates of amplitudes.
fn doubled(model: DampingModel) -> DampingModel {
    let twice = |x: Vec<f64>| x.into_iter().map(|x| 2.0 * x).collect();
    match model {
        DampingModel::Rayleigh { a1, a2 } => DampingModel::Rayleigh { a1: 2.0 * a1, a2: 2.0 * a2 },
        DampingModel::Power { g2, g3 } => DampingModel::Power { g2: 2.0 * g2, g3 },
        DampingModel::Caughey { a } => DampingModel::Caughey { a: twice(a) },
        DampingModel::Hybrid { g1, g2, g3 } => DampingModel::Hybrid { g1: 2.0 * g1, g2: 2.0 * g2, g3 },
        DampingModel::Spline { knots, rises } => DampingModel::Spline { knots, rises: twice(rises) },
    }
}

/// Reads a material.
///
/// # Errors
/// Line and column, the value found, and what is needed: a damping without a convention, numbers out of range, and numbers in another
/// unit.
///
/// # Example
/// ```
/// let text = r#"Material(
///     version: 1,
///     name: "porcelain",
///     damping: (convention: C, model: Rayleigh(a1: 3.9, a2: 1e-8)),
///     elastic: (young: 70e9, poisson: 0.2, density: 2400),
/// )"#;
/// let material = foley_nodes::material::read_material(text.as_bytes())?;
/// assert_eq!(material.elastic.map(|e| e.density), Some(2400.0));
/// # Ok::<(), foley_nodes::warp::TextError>(())
/// ```
pub fn read_material(bytes: &[u8]) -> Result<Material, TextError> {
    let file: FileText = read(decode(bytes)?)?;
    let scale = match file.damping.convention {
        Convention::C => 1.0,
        Convention::D => 2.0,
    };
    let model = file.damping.model.0;
    let intervals = |u: UncertaintyText| {
        let scale = if u.parameter == "g3" || u.parameter == "eta" { 1.0 } else { scale };
        Uncertainty { parameter: u.parameter, low: scale * u.low.0, high: scale * u.high.0 }
    };
    Ok(Material {
        name: file.name,
        damping: if scale == 1.0 { model } else { doubled(model) },
        elastic: file.elastic.map(|e| Elastic {
            young: e.young.0,
            poisson: e.poisson.0,
            density: e.density.0,
            source: e.source,
        }),
        uncertainty: file.uncertainty.into_iter().map(intervals).collect(),
        fit: file.fit.map(|f| FitOrigin {
            estimator: f.estimator,
            points: f.points,
            recordings: f.recordings,
            noise: f.noise.0,
            support: f.support.0,
        }),
        source: file.source,
        licence: file.licence,
    })
}

/// A list of numbers in RON.
fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|x| format!("{x:?}")).collect();
    format!("[{}]", values.join(", "))
}

fn model_text(model: &DampingModel) -> String {
    match model {
        DampingModel::Rayleigh { a1, a2 } => format!("Rayleigh(a1: {a1:?}, a2: {a2:?})"),
        DampingModel::Power { g2, g3 } => format!("Power(g2: {g2:?}, g3: {g3:?})"),
        DampingModel::Caughey { a } => format!("Caughey(a: {})", list(a)),
        DampingModel::Hybrid { g1, g2, g3 } => format!("Hybrid(g1: {g1:?}, g2: {g2:?}, g3: {g3:?})"),
        DampingModel::Spline { knots, rises } => {
            format!("Spline(knots: {}, rises: {})", list(knots), list(rises))
        }
    }
}

/// Writes a material as [`read_material`] reads it, below lines of comments.
#[must_use]
pub fn write_material(material: &Material, comments: &[&str]) -> String {
    let mut all = comments.to_vec();
    all.push("Damping c of z'' + c z' + lambda z = 0, lambda = (2 pi f)^2: 1/s. Young's modulus in Pa, density in kg/m^3.");
    let mut file = TextWriter::new(&all, "Material", MATERIAL_VERSION);
    file.field("name", quote(&material.name));
    file.field("damping", format!("(convention: C, model: {})", model_text(&material.damping)));
    if let Some(e) = &material.elastic {
        let source = quote(&e.source);
        let text = format!(
            "(young: {:?}, poisson: {:?}, density: {:?}, source: {source})",
            e.young, e.poisson, e.density
        );
        file.field("elastic", text);
    }
    if !material.uncertainty.is_empty() {
        file.list(
            "uncertainty",
            material.uncertainty.iter().map(|u| {
                RecordWriter::default()
                    .field("parameter", Some(quote(&u.parameter)))
                    .field("low", Some(format!("{:?}", u.low)))
                    .field("high", Some(format!("{:?}", u.high)))
            }),
        );
    }
    if let Some(f) = &material.fit {
        let text = format!(
            "(estimator: {}, points: {}, recordings: {}, noise: {:?}, support: {:?})",
            quote(&f.estimator),
            f.points,
            f.recordings,
            f.noise,
            f.support
        );
        file.field("fit", text);
    }
    file.field("source", quote(&material.source));
    file.field("licence", quote(&material.licence));
    file.finish()
}

impl Artefact for Material {
    const CODE: &'static str = "F137";
    const HELP: Option<&'static str> = Some("a DampingFit makes materials, and a MaterialOut writes them");

    fn from_file(bytes: &[u8]) -> Result<Self, String> {
        read_material(bytes).map_err(|e| e.to_string())
    }

    fn summary(&self) -> Summary {
        Self::summary(self)
    }
}

impl Data for Material {
    const NAME: &'static str = "material";
    const FILES: bool = true;

    fn trial(rng: &mut Rng) -> Self {
        let damping = match rng.below(3) {
            0 => DampingModel::Rayleigh { a1: rng.between(1.0, 40.0), a2: rng.between(1e-9, 1e-7) },
            1 => DampingModel::Hybrid {
                g1: rng.between(1.0, 40.0),
                g2: rng.between(1e-9, 1e-7),
                g3: rng.between(0.9, 1.1),
            },
            _ => {
                let knots = vec![1e6, 1e7, 1e8, 1e9];
                DampingModel::Spline { knots, rises: (0..6).map(|_| rng.between(0.0, 9.0)).collect() }
            }
        };
        let elastic = (rng.below(2) == 0).then(|| Elastic {
            young: rng.between(2e9, 2e11),
            poisson: rng.between(0.1, 0.4),
            density: rng.between(700.0, 8000.0),
            source: "trial".into(),
        });
        Self { elastic, licence: "CC0-1.0".into(), ..Self::new("trial", damping) }
    }

    fn file(&self) -> Option<Vec<u8>> {
        Some(write_material(self, &[]).into_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let mut rng = Rng::new(3);
        for _ in 0..30 {
            let mut material = Material::trial(&mut rng);
            material.uncertainty.push(Uncertainty { parameter: "a1".into(), low: 1.5, high: 2.5e-8 });
            material.fit = Some(FitOrigin {
                estimator: "Mixture".into(),
                points: 7,
                recordings: 2,
                noise: 0.4,
                support: 8.0,
            });
            material.source = "hands, \"held\"\nby a rim".into();
            let text = write_material(&material, &["A comment."]);
            assert!(text.starts_with("// A comment.\n// Damping c"), "{text}");
            assert_eq!(read_material(text.as_bytes()).unwrap(), material, "{text}");
        }
    }

    #[test]
    fn decay_rates_of_amplitudes_are_doubled() {
        let text = "(version: 1, name: \"x\", damping: (convention: D, model: Hybrid(g1: 2, g2: 1e-9, g3: 1.1)), uncertainty: [(parameter: \"g1\", low: 1, high: 3), (parameter: \"g3\", low: 1, high: 1.2)])";
        let material = read_material(text.as_bytes()).unwrap();
        assert_eq!(material.damping, DampingModel::Hybrid { g1: 4.0, g2: 2e-9, g3: 1.1 });
        assert_eq!((material.uncertainty[0].high, material.uncertainty[1].high), (6.0, 1.2));
    }

    #[test]
    fn mistakes_have_a_line_a_column_and_advice() {
        let file = |damping: &str, more: &str| {
            format!("Material(\n  version: 1,\n  name: \"x\",\n  damping: {damping},\n{more})")
        };
        let good = "(convention: C, model: Rayleigh(a1: 3.9, a2: 1e-8))";
        for (text, part) in [
            (file("(model: Rayleigh(a1: 3.9, a2: 1e-8))", ""), "`convention` is missing"),
            (file("(convention: C, model: Rayleigh(a1: 1e-8, a2: 3.9))", ""), "may be swapped"),
            (file("(convention: C, model: Rayleigh(a1: -1, a2: 1e-8))", ""), "`a1` is -1; a number from 0"),
            (file("(convention: C, model: Rayleigh(a1: 1, a3: 1e-8))", ""), "there is no field `a3`"),
            (file("(convention: E, model: Rayleigh(a1: 1, a2: 1e-8))", ""), "E"),
            (file(good, "  elastic: (young: 70, poisson: 0.2, density: 2400),\n"), "70 GPa are 70e9"),
            (file(good, "  elastic: (young: 70e9, poisson: 0.2, density: 2.4),\n"), "2.4 g/cm^3 are 2400"),
            (
                file(good, "  elastic: (young: 70e9, poisson: 2400, density: 0.2),\n"),
                "found 2400; a number from",
            ),
            (file(good, "  colour: 1,\n"), "there is no field `colour`"),
            ("Material(name: \"x\")".into(), "is missing"),
        ] {
            let e = read_material(text.as_bytes()).unwrap_err();
            assert!(e.message.contains(part), "{text}: {e}");
            if text.starts_with("Material(\n") && !e.message.contains("missing") {
                assert!(e.location.line >= 4, "{e}");
            }
        }
    }
}
