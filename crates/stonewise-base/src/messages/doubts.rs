//! Doubts about a run as a whole.

use super::message::{Message, messages};

messages! {
    DOUBTS {
        NOT_CONVERGED = "not-converged",
        CAUSE_NOT_FIT,
        CAUSE_FIT,
        CAUSE_OPEN,
        SIDE_UNSURE = "outside-unsure",
        BESIDE = "cloud-off-photos",
        COMPARED,
        TORN = "votes-disagree",
        MISREGISTERED_EPOCH = "misregistered-epoch",
        FEW_MEASURED = "few-measured",
        UNCOVERED = "uncovered-wall",
        PART_REFUSED = "part-in-disagreement",
        BLIND = "insensitive",
        STRETCHED = "wrong-scale",
        TURNED = "turned-epoch",
    }
}
