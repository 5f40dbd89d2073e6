//! A sentence that a run says in English and a report in its own language.

use super::braces::fill;

/// A sentence in both languages; words in braces are filled in.
#[derive(Debug)]
pub struct Message {
    /// As a run says it.
    pub english: &'static str,
    /// As a German report says it.
    pub german: &'static str,
}

impl Message {
    /// The sentence as a run says it.
    pub fn say(&self, values: &[(&str, &str)]) -> String {
        fill(self.english, values)
    }
}

/// Declares messages and the list of all of them: a name, the English and the German text of each. Of two that
/// fit the same words the more particular one comes first.
macro_rules! messages {
    ($all:ident { $($name:ident: $english:expr, $german:expr;)* }) => {
        $(
            #[doc = $english]
            pub static $name: Message = Message { english: $english, german: $german };
        )*

        pub(super) static $all: &[&Message] = &[$(&$name),*];
    };
}
pub(super) use messages;
