//! What became of the stones that were looked for in epochs whose photos do not show them.

use crate::error::Result;
use crate::pipeline::context::Context;
use crate::pipeline::steps::carry::CarryAttempt;
use crate::results::names::CARRY_AUDIT;
use std::path::Path;
use stonewise_core::epoch::{EpochId, Epochs};
use stonewise_core::transfer::{CarriedStone, NotCarried};
use stonewise_io::table::{Table, write_csv};

/// What the table as a whole holds.
const DESCRIPTION: &str = "Stones that the photos of one epoch show and those of another do not, or show merged with others, and whether \
    they were found in the cloud of the other, one row per stone and epoch.";

/// Writes `audit_carried.csv` with the metadata of its columns; nothing where no stone was looked for.
pub fn write_carry_audit(context: &Context, attempts: &[CarryAttempt]) -> Result<()> {
    if attempts.is_empty() {
        return Ok(());
    }
    let names = context.project.epochs.map(|e| e.name.as_str());
    write_rows(&context.out.join(CARRY_AUDIT), &names, attempts)
}

fn write_rows(csv: &Path, epochs: &Epochs<&str>, attempts: &[CarryAttempt]) -> Result<()> {
    let name = |epoch: EpochId| epochs[epoch].to_owned();
    let found = |of: &dyn Fn(&CarriedStone) -> f64| {
        let shares = attempts.iter().map(|a| a.outcome.as_ref().ok().map(of));
        shares.collect::<Vec<Option<f64>>>()
    };
    let counts = |of: &dyn Fn(&CarryAttempt) -> u32| attempts.iter().map(of).collect::<Vec<u32>>();
    let into: Vec<String> = attempts.iter().map(|a| name(a.epoch)).collect();
    let from: Vec<String> = attempts.iter().map(|a| name(a.from)).collect();
    let stones: Vec<Option<u32>> = attempts
        .iter()
        .map(|a| a.outcome.as_ref().ok().map(|c| c.stone))
        .collect();
    let points: Vec<Option<u64>> = attempts
        .iter()
        .map(|a| a.outcome.as_ref().ok().map(|c| c.points))
        .collect();
    let reason = |a: &CarryAttempt| {
        a.outcome
            .as_ref()
            .err()
            .map_or(String::new(), NotCarried::to_string)
    };
    let mut table = Table::new();
    table.push("epoch", "", "epoch in whose cloud the stone was looked for", into)?;
    let meaning = "number that the stone got there; empty where it was not carried";
    table.push("stone", "", meaning, stones)?;
    table.push("from_epoch", "", "epoch whose photos show the stone", from)?;
    table.push(
        "from_stone",
        "",
        "number of the stone there",
        counts(&|a| a.stone.0),
    )?;
    table.push(
        "photos",
        "",
        "photos of that epoch that show it",
        counts(&|a| a.photos),
    )?;
    let meaning = "photos of both epochs that face its place and do not show it";
    table.push("missed", "", meaning, counts(&|a| a.missed))?;
    let meaning = "share of its face on which the epoch has points, 0 to 1";
    table.push("covered_share", "", meaning, found(&|c| c.covered_share))?;
    let meaning = "share of that part in which the surface is the same and no other stone's, 0 to 1";
    table.push("same_share", "", meaning, found(&|c| c.same_share))?;
    table.push("points", "", "points that it got", points)?;
    let reasons: Vec<String> = attempts.iter().map(reason).collect();
    table.push("not_carried", "", "why it was not carried; else empty", reasons)?;
    Ok(write_csv(csv, &table, DESCRIPTION, None)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::id::StoneId;
    use stonewise_testing::check_csv_metadata;

    #[test]
    fn a_carried_stone_has_a_number_and_another_one_a_reason() {
        let folder = tempfile::tempdir().unwrap();
        let csv = folder.path().join(CARRY_AUDIT);
        let attempt = |outcome| CarryAttempt {
            epoch: EpochId::at(1),
            from: EpochId::REFERENCE,
            stone: StoneId(7),
            photos: 3,
            missed: 5,
            outcome,
        };
        let carried = CarriedStone {
            stone: 81,
            points: 412,
            covered_share: 0.9,
            same_share: 0.8,
        };
        let outvoted = NotCarried::Outvoted { photos: 1, missed: 9 };
        write_rows(
            &csv,
            &vec!["2024", "2025"].into(),
            &[attempt(Ok(carried)), attempt(Err(outvoted))],
        )
        .unwrap();
        check_csv_metadata(&csv);
        let text = std::fs::read_to_string(&csv).unwrap();
        assert!(text.contains("2025,81,2024,7,3,5,0.9,0.8,412,"), "{text}");
        assert!(
            text.contains("1 photo shows it, 9 that face its place do not"),
            "{text}"
        );
    }
}
