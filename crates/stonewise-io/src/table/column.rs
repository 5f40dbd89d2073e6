//! Columns and the types of their cells.

/// The values of one column, each of which may be empty (null).
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    values: Values,
    /// One flag per row; `None` where the column may not hold empty cells.
    filled: Option<Vec<bool>>,
    /// Whether each cell is a list of integers, written as text with spaces between them.
    is_list: bool,
}

/// A type that cells can have: `f64`, `f32`, `i64`, `u64`, `u32`, `u16`, `u8`, `bool`, `String` or
/// `Vec<u8>`.
pub trait Cell: Clone + Default + sealed::Typed {}

pub(super) mod sealed {
    use crate::table::column::Values;

    pub trait Typed: Sized {
        const NAME: &'static str;
        fn view(values: &Values) -> Option<&[Self]>;
    }
}

macro_rules! cells {
    ($($variant:ident $type:ty, $name:literal;)*) => {
        #[derive(Clone, Debug, PartialEq)]
        /// The values of a column by type.
        pub enum Values { $($variant(Vec<$type>),)* }

        impl Values {
            pub(super) fn len(&self) -> usize {
                match self { $(Self::$variant(v) => v.len(),)* }
            }
            pub(super) fn type_name(&self) -> &'static str {
                match self { $(Self::$variant(_) => $name,)* }
            }
        }

        $(
            impl Cell for $type {}
            impl sealed::Typed for $type {
                const NAME: &'static str = $name;
                fn view(values: &Values) -> Option<&[Self]> {
                    match values { Values::$variant(v) => Some(v), _ => None }
                }
            }
            impl From<Vec<$type>> for Column {
                fn from(values: Vec<$type>) -> Self {
                    Self::new(Values::$variant(values), None)
                }
            }
            impl From<Vec<Option<$type>>> for Column {
                fn from(cells: Vec<Option<$type>>) -> Self {
                    let filled = Some(cells.iter().map(Option::is_some).collect());
                    let values = cells.into_iter().map(Option::unwrap_or_default).collect();
                    Self::new(Values::$variant(values), filled)
                }
            }
        )*
    };
}

cells! {
    F64 f64, "64-bit floats";
    F32 f32, "32-bit floats";
    I64 i64, "signed integers";
    U64 u64, "64-bit unsigned integers";
    U32 u32, "32-bit unsigned integers";
    U16 u16, "16-bit unsigned integers";
    U8 u8, "8-bit unsigned integers";
    Bool bool, "booleans";
    Text String, "text";
    Bytes Vec<u8>, "bytes";
}

/// A list of integers in each cell, written as text with spaces between them.
impl From<Vec<Vec<u32>>> for Column {
    fn from(lists: Vec<Vec<u32>>) -> Self {
        let text = |list: &Vec<u32>| list.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
        Self {
            is_list: true,
            ..lists.iter().map(text).collect::<Vec<String>>().into()
        }
    }
}

impl Column {
    pub(super) fn new(values: Values, filled: Option<Vec<bool>>) -> Self {
        Self {
            values,
            filled,
            is_list: false,
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Whether the cell of a row holds a value.
    pub fn is_filled(&self, row: usize) -> bool {
        self.filled.as_ref().is_none_or(|f| f[row])
    }

    /// All values, where the column is of this type; an empty cell shows as zero or an empty string.
    pub fn values<T: Cell>(&self) -> Option<&[T]> {
        T::view(&self.values)
    }

    pub(super) fn raw(&self) -> &Values {
        &self.values
    }

    pub(super) fn is_list(&self) -> bool {
        self.is_list
    }

    pub(super) fn filled(&self) -> Option<&[bool]> {
        self.filled.as_deref()
    }
}
