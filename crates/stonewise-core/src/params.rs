//! Which values parameters may have: stated once, for the check and for the schema of the project file.

use schemars::Schema;
use serde_json::{Value, json};
use std::fmt;

/// Parameters with the ranges of their values.
pub trait Params {
    /// Every number of the struct with the range in which it must lie.
    fn ranges(&self) -> Vec<Ranged> {
        Vec::new()
    }

    /// Parameters that are part of these, by key.
    fn parts(&self) -> Vec<(&'static str, &dyn Params)> {
        Vec::new()
    }

    /// Checks what the ranges of single numbers do not say.
    ///
    /// # Errors
    /// Names the first value that cannot be.
    fn check_relations(&self) -> Result<(), ParamError> {
        Ok(())
    }

    /// Checks every value.
    ///
    /// # Errors
    /// Names the first value that cannot be.
    fn check(&self) -> Result<(), ParamError> {
        for ranged in self.ranges() {
            ranged.check()?;
        }
        self.check_relations()?;
        for (key, part) in self.parts() {
            part.check().map_err(|error| error.within(key))?;
        }
        Ok(())
    }
}

/// A parameter with a value that it cannot have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key} = {value} is not possible: it must be {allowed}")]
pub struct ParamError {
    /// The parameter, with the tables that it is in: `registration.adjustment.min_points`.
    pub key: String,
    /// Its value.
    pub value: String,
    /// What it may be.
    pub allowed: String,
}

impl ParamError {
    /// The error of one parameter.
    pub fn new(key: impl Into<String>, value: impl fmt::Display, allowed: impl fmt::Display) -> Self {
        Self {
            key: key.into(),
            value: value.to_string(),
            allowed: allowed.to_string(),
        }
    }

    /// Puts the name of the parameter's table before its key.
    #[must_use]
    pub fn within(mut self, table: &str) -> Self {
        self.key = format!("{table}.{}", self.key);
        self
    }
}

/// An interval of finite numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    least: f64,
    /// Whether `least` itself is allowed.
    is_closed: bool,
    most: f64,
}

impl Range {
    /// Numbers above 0.
    pub const POSITIVE: Self = Self {
        least: 0.0,
        is_closed: false,
        most: f64::INFINITY,
    };
    /// 0 and above.
    pub const NOT_NEGATIVE: Self = Self::between(0.0, f64::INFINITY);
    /// Shares and probabilities.
    pub const SHARE: Self = Self::between(0.0, 1.0);

    /// Both ends included.
    pub const fn between(least: f64, most: f64) -> Self {
        Self {
            least,
            is_closed: true,
            most,
        }
    }

    /// States that a parameter lies in the range.
    pub fn holds(self, key: &'static str, numbers: impl Numbers) -> Ranged {
        Ranged {
            key,
            numbers: numbers.numbers(),
            range: self,
        }
    }

    fn contains(self, number: f64) -> bool {
        let is_above = number > self.least || (self.is_closed && number == self.least);
        is_above && number <= self.most && number.is_finite()
    }

    /// The keywords of JSON schema, for integers or for all numbers.
    fn keywords(self, is_integer: bool) -> Vec<(&'static str, Value)> {
        let least = match (self.is_closed, is_integer) {
            (true, _) => ("minimum", json_number(self.least)),
            (false, true) => ("minimum", json_number(self.least + 1.0)),
            (false, false) => ("exclusiveMinimum", json_number(self.least)),
        };
        let most = self.most.is_finite().then(|| ("maximum", json_number(self.most)));
        [least].into_iter().chain(most).collect()
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match (self.most.is_finite(), self.is_closed) {
            (true, _) => write!(f, "{} to {}", self.least, self.most),
            (false, true) => write!(f, "{} or more", self.least),
            (false, false) => write!(f, "above {}", self.least),
        }
    }
}

/// A parameter with its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranged {
    key: &'static str,
    numbers: Vec<f64>,
    range: Range,
}

impl Ranged {
    fn check(&self) -> Result<(), ParamError> {
        let Some(number) = self.numbers.iter().find(|n| !self.range.contains(**n)) else {
            return Ok(());
        };
        let allowed = match number.is_finite() {
            true => self.range.to_string(),
            false => format!("a finite number, {}", self.range),
        };
        Err(ParamError::new(self.key, number, allowed))
    }
}

/// What a range can be stated of: a number, a list of numbers, or one that may be absent.
pub trait Numbers {
    /// The numbers.
    fn numbers(&self) -> Vec<f64>;
}

impl Numbers for f64 {
    fn numbers(&self) -> Vec<f64> {
        vec![*self]
    }
}

impl Numbers for u32 {
    fn numbers(&self) -> Vec<f64> {
        vec![f64::from(*self)]
    }
}

impl Numbers for usize {
    fn numbers(&self) -> Vec<f64> {
        vec![*self as f64]
    }
}

impl<T: Numbers> Numbers for Option<T> {
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(Numbers::numbers).collect()
    }
}

impl<T: Numbers, const N: usize> Numbers for [T; N] {
    fn numbers(&self) -> Vec<f64> {
        self.as_slice().numbers()
    }
}

impl<T: Numbers> Numbers for &[T] {
    fn numbers(&self) -> Vec<f64> {
        self.iter().flat_map(Numbers::numbers).collect()
    }
}

/// Units by the last part of a parameter's key.
const UNITS: [(&str, &str); 6] = [
    ("m", "m"),
    ("mm", "mm"),
    ("rad", "rad"),
    ("deg", "deg"),
    ("px", "px"),
    ("mib", "MiB"),
];

/// Completes the schema of parameters: the range of each number, and its unit as `x-unit`.
pub fn with_ranges<P: Params + Default>(schema: &mut Schema) {
    let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) else {
        return;
    };
    for ranged in P::default().ranges() {
        let Some(property) = properties.get_mut(ranged.key).and_then(Value::as_object_mut) else {
            continue;
        };
        let suffix = ranged.key.rsplit('_').next();
        if let Some((_, unit)) = UNITS.iter().find(|(end, _)| Some(*end) == suffix) {
            property.insert("x-unit".to_owned(), json!(unit));
        }
        let is_list = property.contains_key("items");
        let number = if is_list {
            property.get_mut("items").and_then(Value::as_object_mut)
        } else {
            Some(property)
        };
        if let Some(number) = number {
            let is_integer = number
                .get("type")
                .is_some_and(|t| t.to_string().contains("integer"));
            let keywords = ranged.range.keywords(is_integer);
            number.extend(keywords.into_iter().map(|(key, limit)| (key.to_owned(), limit)));
        }
    }
}

/// A number as JSON writes it shortest: integers without a decimal point.
fn json_number(number: f64) -> Value {
    if number.fract() == 0.0 {
        json!(number as i64)
    } else {
        json!(number)
    }
}
