//! Inputs must not lie where results go.

use crate::error::{Error, Result};
use crate::files::resolved;
use std::path::{Path, PathBuf};

/// Refuses an output folder in which results would replace an input, or that lies inside a folder of inputs.
///
/// `folders`, `is_written`: what is written, relative to `out`: everything in these folders, and files of
/// these names. Inputs are compared where they lie and, if they are links, where they point.
pub(super) fn refuse_overwriting(
    out: &Path,
    inputs: &[PathBuf],
    folders: &[PathBuf],
    is_written: &dyn Fn(&Path) -> bool,
) -> Result<()> {
    let target = resolved(out);
    let written: Vec<PathBuf> = folders.iter().map(|f| resolved(&out.join(f))).collect();
    for input in inputs {
        let name = input.file_name().unwrap_or_default();
        let as_named = input.parent().map(|p| resolved(p).join(name));
        for place in [Some(resolved(input)), as_named].into_iter().flatten() {
            if place.is_dir() && target.starts_with(&place) {
                return Err(Error::Output {
                    path: out.to_path_buf(),
                    message: format!(
                        "the results would lie inside the folder of inputs {}: give another --out",
                        input.display()
                    ),
                });
            }
            let in_folder = written.iter().any(|f| place.starts_with(f));
            let replaced = place.strip_prefix(&target).is_ok_and(is_written);
            if in_folder || replaced {
                return Err(Error::Output {
                    path: out.to_path_buf(),
                    message: format!(
                        "the results would be written over the input {}: give a folder of its own as --out",
                        input.display()
                    ),
                });
            }
        }
    }

    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn refused(out: &Path, input: &Path) -> Option<String> {
        let is_written = |name: &Path| name == Path::new("stones.csv");
        refuse_overwriting(out, &[input.to_path_buf()], &["epoch1".into()], &is_written)
            .err()
            .map(|e| e.to_string())
    }

    #[test]
    fn inputs_in_the_way_are_found_however_they_are_written() {
        let dir = tempfile::tempdir().unwrap();
        let survey = dir.path().join("survey");
        fs::create_dir_all(survey.join("epoch1/images")).unwrap();
        let cloud = survey.join("epoch1/cloud.laz");
        fs::write(&cloud, "x").unwrap();
        assert!(refused(&survey, &cloud).unwrap().contains("cloud.laz"));
        assert!(refused(&survey.join("../survey/epoch1/.."), &cloud).is_some());
        assert!(refused(&survey, &survey.join("stones.csv")).is_some());
        assert!(refused(&survey, &survey.join("scans/stones.csv")).is_none());
        assert!(refused(&dir.path().join("results"), &cloud).is_none());
        let inside = survey.join("epoch1/images/results");
        assert!(
            refused(&inside, &survey.join("epoch1/images"))
                .unwrap()
                .contains("inside")
        );
    }

    #[cfg(unix)]
    #[test]
    fn links_hide_nothing() {
        use std::os::unix::fs::symlink;
        let dir = tempfile::tempdir().unwrap();
        let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
        fs::create_dir_all(survey.join("scans")).unwrap();
        fs::create_dir(&out).unwrap();
        let cloud = survey.join("scans/cloud.laz");
        fs::write(&cloud, "x").unwrap();
        symlink(survey.join("scans"), out.join("epoch1")).unwrap();
        assert!(refused(&out, &cloud).is_some(), "a linked folder of results");
        fs::remove_file(out.join("epoch1")).unwrap();
        fs::create_dir(out.join("epoch1")).unwrap();
        symlink(&cloud, out.join("epoch1/cloud.laz")).unwrap();
        assert!(
            refused(&out, &out.join("epoch1/cloud.laz")).is_some(),
            "a linked input"
        );
        assert!(refused(&out, &cloud).is_none());
    }
}
