//! The page's own files, which the program carries.

use crate::http::{Body, Response};
use stonewise::Language;

/// The media type of pages.
pub const HTML: &str = "text/html; charset=utf-8";

/// The program; `web/README.md` says how it is built from its sources.
const SCRIPT: &str = include_str!("../assets/studio.js");
/// Its style sheet.
const STYLE: &str = include_str!("../assets/studio.css");

/// The page, empty until its program runs.
pub fn shell(language: Language) -> Response {
    let tag = language.tag();
    let page = format!(
        "<!doctype html>\n<html lang=\"{tag}\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>stonewise studio</title>\n\
         <link rel=\"icon\" href=\"data:,\">\n<link rel=\"stylesheet\" href=\"/studio.css\">\n\
         <script src=\"/studio.js\" defer></script>\n</head>\n<body><div id=\"studio\"></div></body>\n</html>\n"
    );
    Response::new(200, HTML, Body::Bytes(page.into_bytes().into()))
}

/// The page's program.
pub fn script() -> Response {
    Response::new(
        200,
        "text/javascript; charset=utf-8",
        Body::Bytes(SCRIPT.as_bytes().into()),
    )
}

/// The page's style sheet.
pub fn style() -> Response {
    Response::new(
        200,
        "text/css; charset=utf-8",
        Body::Bytes(STYLE.as_bytes().into()),
    )
}
