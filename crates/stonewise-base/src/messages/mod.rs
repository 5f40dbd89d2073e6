//! What a run says, in each language.

mod braces;
mod doubts;
pub mod findings;
mod message;
pub mod notices;
mod remarks;
mod said;

pub use braces::fill;
pub use doubts::{
    BESIDE, BLIND, CAUSE_FIT, CAUSE_NOT_FIT, CAUSE_OPEN, COMPARED, FEW_MEASURED, MISREGISTERED_EPOCH,
    NOT_CONVERGED, PART_REFUSED, SIDE_UNSURE, STRETCHED, TORN, TURNED, UNCOVERED,
};
pub use message::Message;
pub use said::{Said, Translations, recorded};
