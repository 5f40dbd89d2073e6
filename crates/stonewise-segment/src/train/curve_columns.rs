//! What the curves of a training hold: names, units and meanings of their columns.

use super::trainer::StepFigures;
use stonewise_io::table::{Table, TableError};

/// What `loss.csv` holds.
pub const LOSS_DESCRIPTION: &str = "Losses of a training of the stone detector, one row for each step";
/// What `validation.csv` holds.
pub const VALIDATION_DESCRIPTION: &str = "Figures of the stone detector on images that it does not learn from, one row for each time that they were computed";
/// Meanings of the parts of the loss, in their order.
const LOSS_MEANINGS: [&str; 5] = [
    "cross entropy of whether an anchor shows a stone",
    "smooth L1 loss of the proposals' boxes",
    "cross entropy of the class of the proposals",
    "smooth L1 loss of the refined boxes",
    "cross entropy of the masks' pixels",
];

/// Columns of `loss.csv`, without rows.
pub fn loss_columns() -> Result<Table, TableError> {
    let mut table = begun()?;
    let numbers = Vec::<f64>::new;
    table.push("learning_rate", "", "learning rate of the step", numbers())?;
    table.push(
        "gradient_norm",
        "",
        "length of the gradient before clipping",
        numbers(),
    )?;
    table.push(
        "waited_s",
        "s",
        "time that the step waited for its images",
        numbers(),
    )?;
    for (name, meaning) in StepFigures::LOSSES.into_iter().zip(LOSS_MEANINGS) {
        table.push(
            name,
            "",
            &format!("{meaning}, mean over the images of the step"),
            numbers(),
        )?;
    }
    table.push("total", "", "sum of the five losses", numbers())?;
    Ok(table)
}

/// Columns of `validation.csv`, without rows.
pub fn validation_columns() -> Result<Table, TableError> {
    let mut table = begun()?;
    let figures = [
        (
            "precision",
            "share of the found stones that are stones, pairs overlapping by IoU 0.5 or more",
        ),
        (
            "recall",
            "share of the stones that were found, pairs overlapping by IoU 0.5 or more",
        ),
        ("f1", "harmonic mean of precision and recall"),
        ("mean_iou", "mean intersection over union of the pairs"),
        ("ap50", "average precision at IoU 0.5"),
        ("ap", "average precision, mean over IoU 0.5 to 0.95"),
    ];
    for (name, meaning) in figures {
        table.push(
            name,
            "",
            &format!("{meaning}, 0 to 1; 0 where nothing was found or sought"),
            Vec::<f64>::new(),
        )?;
    }
    Ok(table)
}

/// The columns that both begin with.
fn begun() -> Result<Table, TableError> {
    let mut table = Table::new();
    table.push("step", "", "steps done", Vec::<u64>::new())?;
    table.push(
        "seconds",
        "s",
        "time since the training began, without interruptions",
        Vec::<f64>::new(),
    )?;
    Ok(table)
}
