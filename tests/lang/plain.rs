//! A document as `ron` passes it to a visitor, with order and duplicates, unlike `ron::Value`.

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

#[derive(Debug, PartialEq)]
pub enum Plain {
    Unit,
    Bool(bool),
    Char(char),
    Int(i128),
    /// The bits, so that NaN equals itself and the sign of zero counts.
    Float(u64),
    Str(String),
    Bytes(Vec<u8>),
    Option(Option<Box<Plain>>),
    Seq(Vec<Plain>),
    Map(Vec<(Plain, Plain)>),
}

impl Plain {
    #[allow(dead_code)] // only one of the tests that share this makes values itself
    pub fn float(number: f64) -> Self {
        let number = if number.is_nan() { f64::NAN } else { number };
        Plain::Float(number.to_bits())
    }
}

impl<'de> Deserialize<'de> for Plain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(PlainVisitor)
    }
}

struct PlainVisitor;

impl<'de> Visitor<'de> for PlainVisitor {
    type Value = Plain;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("anything")
    }
    fn visit_bool<E>(self, v: bool) -> Result<Plain, E> {
        Ok(Plain::Bool(v))
    }
    fn visit_i64<E>(self, v: i64) -> Result<Plain, E> {
        Ok(Plain::Int(v.into()))
    }
    fn visit_u64<E>(self, v: u64) -> Result<Plain, E> {
        Ok(Plain::Int(v.into()))
    }
    fn visit_f64<E>(self, v: f64) -> Result<Plain, E> {
        Ok(Plain::float(v))
    }
    fn visit_char<E>(self, v: char) -> Result<Plain, E> {
        Ok(Plain::Char(v))
    }
    fn visit_str<E>(self, v: &str) -> Result<Plain, E> {
        Ok(Plain::Str(v.to_owned()))
    }
    fn visit_bytes<E>(self, v: &[u8]) -> Result<Plain, E> {
        Ok(Plain::Bytes(v.to_vec()))
    }
    fn visit_none<E>(self) -> Result<Plain, E> {
        Ok(Plain::Option(None))
    }
    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<Plain, D::Error> {
        Ok(Plain::Option(Some(Box::new(Plain::deserialize(deserializer)?))))
    }
    fn visit_unit<E>(self) -> Result<Plain, E> {
        Ok(Plain::Unit)
    }
    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Plain, A::Error> {
        let mut all = Vec::new();
        while let Some(next) = seq.next_element()? {
            all.push(next);
        }
        Ok(Plain::Seq(all))
    }
    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Plain, A::Error> {
        let mut all = Vec::new();
        while let Some(next) = map.next_entry()? {
            all.push(next);
        }
        Ok(Plain::Map(all))
    }
}
