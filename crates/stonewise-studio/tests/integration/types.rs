//! The types of the page's program are those of the API.

use std::path::Path;

#[test]
fn the_types_of_the_page_are_those_of_the_api() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../web/studio/api.ts");
    let made = stonewise_studio::typescript();
    if std::env::var_os("STONEWISE_WRITE").is_some() {
        std::fs::write(&path, &made).unwrap();
    }
    if !path.parent().unwrap().exists() {
        println!("skipped: the sources of the page are not here");
        return;
    }
    let written = std::fs::read_to_string(&path).unwrap();
    assert_eq!(
        written, made,
        "STONEWISE_WRITE=1 cargo test -p stonewise-studio --test integration types writes web/studio/api.ts anew"
    );
}
