//! Values of TOML for serde.
//!
//! The `toml` crate has its own reader. It compiles the reading of each declared type four
//! times, also as a date and as a value with its place; this one does it once, which is a
//! sixth of the time that the library takes to build. Its messages and places are the same.

use serde::de::value::{StrDeserializer, StringDeserializer};
use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error as _, IntoDeserializer, MapAccess, SeqAccess,
    VariantAccess, Visitor,
};
use serde::forward_to_deserialize_any;
use std::borrow::Cow;
use std::fmt::{Display, Formatter};
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What is wrong with a value, and where it stands in the text.
#[derive(Debug)]
pub(super) struct Misfit {
    pub(super) message: String,
    pub(super) span: Option<Range<usize>>,
}

impl Misfit {
    fn new(message: impl Display, span: &Range<usize>) -> Self {
        Self { message: message.to_string(), span: Some(span.clone()) }
    }

    /// With this place, unless a narrower one is known.
    fn at(mut self, span: Range<usize>) -> Self {
        self.span.get_or_insert(span);
        self
    }
}

impl Display for Misfit {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Misfit {}

impl serde::de::Error for Misfit {
    fn custom<T: Display>(message: T) -> Self {
        Self { message: message.to_string(), span: None }
    }
}

/// A value to be read.
pub(super) struct Node<'de> {
    value: DeValue<'de>,
    span: Range<usize>,
}

impl<'de> Node<'de> {
    /// The table that a text is.
    ///
    /// # Errors
    /// When it is no TOML.
    pub(super) fn parse(text: &'de str) -> Result<Self, Misfit> {
        let table = DeTable::parse(text)
            .map_err(|error| Misfit { message: error.message().to_owned(), span: error.span() })?;
        let span = table.span();
        Ok(Self { value: DeValue::Table(table.into_inner()), span })
    }

    fn of(value: Spanned<DeValue<'de>>) -> Self {
        let span = value.span();
        Self { value: value.into_inner(), span }
    }
}

impl<'de> Deserializer<'de> for Node<'de> {
    type Error = Misfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let Self { value, span } = self;
        match value {
            DeValue::String(Cow::Borrowed(text)) => visitor.visit_borrowed_str(text),
            DeValue::String(Cow::Owned(text)) => visitor.visit_string(text),
            DeValue::Integer(number) => {
                let (digits, radix) = (number.as_str(), number.radix());
                match i64::from_str_radix(digits, radix) {
                    Ok(number) => visitor.visit_i64(number),
                    Err(_) => match u64::from_str_radix(digits, radix) {
                        Ok(number) => visitor.visit_u64(number),
                        Err(_) => Err(Misfit::custom("integer number overflowed")),
                    },
                }
            }
            DeValue::Float(number) => {
                let text = number.as_str();
                match text.parse::<f64>() {
                    Ok(number) if number.is_finite() || text.contains("inf") => {
                        visitor.visit_f64(number)
                    }
                    Ok(number) if number.is_nan() => visitor.visit_f64(number),
                    _ => Err(Misfit::custom("floating-point number overflowed")),
                }
            }
            DeValue::Boolean(truth) => visitor.visit_bool(truth),
            DeValue::Datetime(_) => Err(Misfit::custom("dates have no meaning here")),
            DeValue::Array(values) => visitor.visit_seq(Values(values.into_iter())),
            DeValue::Table(entries) => {
                visitor.visit_map(Entries { rest: entries.into_iter(), value: None })
            }
        }
        .map_err(|misfit| misfit.at(span))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let span = self.span.clone();
        visitor.visit_some(self).map_err(|misfit| misfit.at(span))
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        let span = self.span.clone();
        visitor.visit_newtype_struct(self).map_err(|misfit| misfit.at(span))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        let Self { value, span } = self;
        let found = |count: &str| format!("wanted exactly 1 element, {count}");
        match value {
            DeValue::String(name) => {
                let name: StringDeserializer<Misfit> = name.into_owned().into_deserializer();
                visitor.visit_enum(name)
            }
            DeValue::Table(entries) => {
                let mut entries = entries.into_iter();
                match (entries.next(), entries.next()) {
                    (Some((name, value)), None) => visitor.visit_enum(Variant { name, value }),
                    (None, _) => Err(Misfit::custom(found("found 0 elements"))),
                    _ => Err(Misfit::custom(found("more than 1 element"))),
                }
            }
            _ => Err(Misfit::custom("wanted string or table")),
        }
        .map_err(|misfit| misfit.at(span))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// The values of an array.
struct Values<'de>(std::vec::IntoIter<Spanned<DeValue<'de>>>);

impl<'de> SeqAccess<'de> for Values<'de> {
    type Error = Misfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Misfit> {
        self.0.next().map(|value| seed.deserialize(Node::of(value))).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

/// The entries of a table.
struct Entries<'de, I> {
    rest: I,
    /// That of the key which was read last.
    value: Option<Spanned<DeValue<'de>>>,
}

impl<'de, I> MapAccess<'de> for Entries<'de, I>
where
    I: Iterator<Item = (Spanned<Cow<'de, str>>, Spanned<DeValue<'de>>)>,
{
    type Error = Misfit;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Misfit> {
        let Some((key, value)) = self.rest.next() else { return Ok(None) };
        self.value = Some(value);
        let name = StrDeserializer::new(key.get_ref());
        seed.deserialize(name).map(Some).map_err(|misfit: Misfit| misfit.at(key.span()))
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, Misfit> {
        let value = self.value.take().expect("a value follows its key");
        seed.deserialize(Node::of(value))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.rest.size_hint().0)
    }
}

/// A variant of an enum with what it holds.
struct Variant<'de> {
    name: Spanned<Cow<'de, str>>,
    value: Spanned<DeValue<'de>>,
}

impl<'de> EnumAccess<'de> for Variant<'de> {
    type Error = Misfit;
    type Variant = Node<'de>;

    fn variant_seed<T: DeserializeSeed<'de>>(
        self,
        seed: T,
    ) -> Result<(T::Value, Node<'de>), Misfit> {
        let name = StrDeserializer::new(self.name.get_ref());
        let variant =
            seed.deserialize(name).map_err(|misfit: Misfit| misfit.at(self.name.span()))?;
        Ok((variant, Node::of(self.value)))
    }
}

impl<'de> VariantAccess<'de> for Node<'de> {
    type Error = Misfit;

    fn unit_variant(self) -> Result<(), Misfit> {
        match self.value {
            DeValue::Array(values) if values.is_empty() => Ok(()),
            DeValue::Table(entries) if entries.is_empty() => Ok(()),
            _ => Err(Misfit::new("expected an empty table", &self.span)),
        }
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Misfit> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Misfit> {
        self.deserialize_any(visitor)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        self.deserialize_any(visitor)
    }
}
