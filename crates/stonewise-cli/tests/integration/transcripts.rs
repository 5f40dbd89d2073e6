//! What the command says, word for word: `tests/transcripts` can be read as documentation. `TRYCMD=overwrite` writes
//! the answers of now into the files.

use crate::support::program;

#[test]
fn the_command_says_what_its_transcripts_say() {
    trycmd::TestCases::new()
        .register_bin("stonewise", trycmd::schema::Bin::Path(program()))
        .case("tests/transcripts/*.trycmd");
}
