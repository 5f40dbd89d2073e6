//! Keeps the modules of core in their order: a module uses only those below it, and the stages never each other.
#![allow(clippy::unwrap_used)] // a test that cannot read the sources must stop

use std::fs;
use std::path::Path;

/// Modules from the bottom up; those on one line do not see each other.
const LAYERS: [&[&str]; 9] = [
    &["id"],
    &["progress"],
    &["geometry"],
    &["raster"],
    &["cloud"],
    &["stone"],
    &["transfer", "matching", "registration", "change"],
    &["evaluate"],
    &["simulate"],
];

#[test]
fn modules_use_only_those_below_them() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut uses = 0;
    for (level, modules) in LAYERS.iter().enumerate() {
        for module in *modules {
            for file in rust_files(&src, module) {
                for used in used_modules(&fs::read_to_string(&file).unwrap()) {
                    let below = LAYERS[..level].iter().any(|l| l.contains(&used.as_str()));
                    assert!(
                        below || used == *module,
                        "{} uses {used}, which is not below {module}",
                        file.display()
                    );
                    uses += 1;
                }
            }
        }
    }
    assert!(uses > 10, "only {uses} uses found: the search is broken");
}

fn rust_files(src: &Path, module: &str) -> Vec<std::path::PathBuf> {
    let mut found = vec![];
    let mut open = vec![src.join(module), src.join(format!("{module}.rs"))];
    while let Some(path) = open.pop() {
        if path.is_dir() {
            open.extend(fs::read_dir(&path).unwrap().map(|e| e.unwrap().path()));
        } else if path.extension().is_some_and(|e| e == "rs") && path.exists() {
            found.push(path);
        }
    }
    found
}

/// First path segment after every `crate::`, outside comments.
fn used_modules(text: &str) -> Vec<String> {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or(""));
    let name = |rest: &str| {
        rest.chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect::<String>()
    };
    code.flat_map(|line| line.split("crate::").skip(1).map(name).collect::<Vec<_>>())
        .collect()
}
