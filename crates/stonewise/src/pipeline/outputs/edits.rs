//! What became of the edits by hand.

use crate::error::Result;
use crate::files::write_readable_json;
use crate::pipeline::context::Context;
use crate::pipeline::steps::edit::Edited;
use crate::results::names::{EDITS_AUDIT, FACADE};
use crate::texts::Said;
use crate::texts::notices::EDIT_WITHOUT_EFFECT;
use stonewise_core::transfer::{EditEffect, NoEffect};
use stonewise_io::table::{Table, write_csv};

/// What the table as a whole holds.
const DESCRIPTION: &str = "Edits by hand and what each did in each epoch, one row per edit and epoch.";

/// Writes `audit_edits.csv`, one row for each edit and epoch, with the metadata of its columns, and
/// `facade.json`, the wall on which the stones
/// are unrolled; names edits that did nothing in any epoch. Nothing where the project has no edits.
pub fn write_edits_audit(context: &Context, edited: Option<&Edited>) -> Result<()> {
    let (Some(edited), Some(file)) = (edited, &context.project.edits) else {
        return Ok(());
    };
    write_readable_json(&context.out.join(FACADE), &edited.facade)?;
    let mut rows = Vec::new();

    for (index, edit) in file.edits.iter().enumerate() {
        let mut reasons = Vec::new();
        for (epoch, effects) in context.project.epochs.iter().zip(&edited.effects) {
            let Some(effect) = &effects[index] else { continue };
            if let Err(reason) = effect {
                reasons.push((&epoch.name, Said::from(reason)));
            }
            rows.push((index, epoch.name.clone(), effect));
        }
        let has_effect = edited
            .effects
            .iter()
            .any(|epoch| matches!(epoch[index], Some(Ok(_))));
        if !has_effect {
            let reasons = Said::in_each(|language| {
                let [colon, between] = ["language.colon", "language.clause"].map(|key| language.text(key));
                let texts = reasons
                    .iter()
                    .map(|(epoch, reason)| format!("{epoch}{colon}{}", reason.text(language)));
                texts.collect::<Vec<_>>().join(between)
            });
            let words = [("edit", edit.action.word().into()), ("reasons", reasons)];
            let message = EDIT_WITHOUT_EFFECT.say(&words);
            context.warnings.skipped("edit", file.place(index), message);
        }
    }

    let edit = |row: &Row| &file.edits[row.0];
    let text = |of: &dyn Fn(&Row) -> String| rows.iter().map(|r| one_line(&of(r))).collect::<Vec<_>>();
    let done = |row: &Row| row.2.as_ref().ok().cloned();
    let stones = |of: &dyn Fn(EditEffect) -> Vec<u32>| {
        let lists = rows.iter().map(|r| done(r).map_or(Vec::new(), of));
        lists.collect::<Vec<Vec<u32>>>()
    };
    let numbers: Vec<u32> = rows.iter().map(|r| r.0 as u32 + 1).collect();
    let points: Vec<Option<u64>> = rows.iter().map(|r| done(r).map(|e| e.points)).collect();
    let mut table = Table::new();
    table.push("edit", "", "number of the edit in the file, from 1", numbers)?;
    let meaning = "merge, split, delete, add or ignore";
    table.push("do", "", meaning, text(&|r| edit(r).action.word().to_owned()))?;
    table.push("who", "", "who made the edit", text(&|r| edit(r).who.clone()))?;

    table.push("when", "", "when it was made", text(&|r| edit(r).when.clone()))?;
    table.push("why", "", "why it was made", text(&|r| edit(r).why.clone()))?;
    let meaning = "the file of edits and the place in it";
    table.push("place", "", meaning, text(&|r| file.place(r.0)))?;
    table.push(
        "drawn_in",
        "",
        "the photo in which it was drawn, or facade",
        text(&|r| edit(r).photo.clone().unwrap_or("facade".to_owned())),
    )?;
    table.push("epoch", "", "name of the epoch", text(&|r| r.1.clone()))?;
    let before = stones(&|e| e.before);
    table.push("stones_before", "", "stones that the edit changed", before)?;
    let after = stones(&|e| e.after);

    table.push("stones_after", "", "stones that the edit made or changed", after)?;
    let meaning = "points whose label changed; empty where the edit had no effect";
    table.push("points", "", meaning, points)?;
    table.push(
        "no_effect",
        "",
        "why it did nothing in this epoch; empty where it did something",
        text(&|r| r.2.as_ref().err().map_or(String::new(), NoEffect::to_string)),
    )?;

    Ok(write_csv(
        &context.out.join(EDITS_AUDIT),
        &table,
        DESCRIPTION,
        None,
    )?)
}

/// Edit, epoch, and what it did there.
type Row<'a> = (usize, String, &'a std::result::Result<EditEffect, NoEffect>);

/// A text without line breaks, which rows of the audit do not have.
fn one_line(text: &str) -> String {
    text.split(['\r', '\n'])
        .map(str::trim)
        .collect::<Vec<_>>()
        .join(" ")
        .trim()
        .to_owned()
}

/// Says how many steps had to be done again, where the project has edits.
pub fn tell_steps(context: &Context) {
    let Some(file) = &context.project.edits else {
        return;
    };
    let times = context.times();
    let kept = times.iter().filter(|t| t.resumed).count();
    context.progress.note(&format!(
        "edits: {} by hand; {kept} of {} steps were taken over, {} done",
        file.edits.len(),
        times.len(),
        times.len() - kept
    ));
}
