//! The letters of a file: UTF-8, or before AutoCAD 2007 those of the code page that it names.

use super::one_byte::{self, Upper};

/// The number of the first version, that of AutoCAD 2007, whose files are UTF-8.
const UNICODE: f64 = 1021.0;

/// What says, before the first letter, that a file is UTF-8.
const MARK: &str = "\u{FEFF}";

/// How bytes stand for letters.
#[derive(Debug, Clone, Copy)]
enum CodePage {
    /// Each byte is a letter.
    OneByte(&'static Upper),
    /// Letters that are not in ASCII may take two bytes.
    #[cfg(not(target_arch = "wasm32"))]
    TwoBytes(&'static encoding_rs::Encoding),
}

/// The text of a file, and what the user is told of its letters.
pub(super) fn decoded(bytes: Vec<u8>) -> (String, Option<String>) {
    let name = variable(&bytes, "$DWGCODEPAGE").unwrap_or_default().to_owned();
    let code_page = known(&name);
    let bytes = match String::from_utf8(bytes) {
        Ok(text) if code_page.is_some() && is_in_code_page(&text) => {
            let note = format!(
                "the letters of the file are read in its code page ({name}), but may be UTF-8: if \
                 they are drawn wrongly, save it as a DXF of AutoCAD 2007 or newer"
            );
            return (by(code_page, text.as_bytes()), Some(note));
        }
        Ok(text) => return (text, None),
        Err(error) => error.into_bytes(),
    };
    let is_unknown = code_page.is_none() && !name.is_empty();
    let note = is_unknown.then(|| {
        format!(
            "the code page of the file ({name}) is not known: its letters are read as Latin-1, so \
             some may be wrong"
        )
    });
    (by(code_page, &bytes), note)
}

/// Whether a file that names a known code page uses it, although its bytes are UTF-8 as well.
fn is_in_code_page(text: &str) -> bool {
    let version = variable(text.as_bytes(), "$ACADVER").and_then(|name| name.strip_prefix("AC"));
    // The first versions have names such as AC2.10.
    let number = version.and_then(|number| number.parse::<f64>().ok());
    !text.is_ascii() && !text.starts_with(MARK) && number.is_some_and(|number| number < UNICODE)
}

/// The letters that bytes stand for; those of Latin-1 where the code page is not known.
fn by(code_page: Option<CodePage>, bytes: &[u8]) -> String {
    match code_page {
        Some(CodePage::OneByte(upper)) => bytes.iter().map(|byte| letter(upper, *byte)).collect(),
        #[cfg(not(target_arch = "wasm32"))]
        Some(CodePage::TwoBytes(encoding)) => {
            encoding.decode_without_bom_handling(bytes).0.into_owned()
        }
        None => bytes.iter().copied().map(char::from).collect(),
    }
}

/// The letter of a byte: below 0x80 that of ASCII.
fn letter(upper: &Upper, byte: u8) -> char {
    let number = byte.checked_sub(0x80).and_then(|index| upper.get(usize::from(index)));
    number.map_or(byte.into(), |number| {
        char::from_u32(u32::from(*number)).unwrap_or(char::REPLACEMENT_CHARACTER)
    })
}

/// The value of a variable of the header.
fn variable<'b>(bytes: &'b [u8], name: &str) -> Option<&'b str> {
    let mut lines = bytes.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let mut pairs = std::iter::from_fn(|| Some((lines.next()?, lines.next()?)));
    pairs.find(|pair| *pair == (b"9", name.as_bytes()))?;
    let (_, value) = pairs.next()?;
    str::from_utf8(value).ok()
}

/// The code page with this name of AutoCAD; `None` if it is not known.
fn known(name: &str) -> Option<CodePage> {
    let name = name.to_ascii_uppercase();
    one_byte::upper(&name).map(CodePage::OneByte).or_else(|| two_bytes(&name))
}

/// The code page with this name whose letters may take two bytes.
#[cfg(not(target_arch = "wasm32"))]
fn two_bytes(name: &str) -> Option<CodePage> {
    Some(CodePage::TwoBytes(match name {
        "ANSI_932" | "DOS932" => encoding_rs::SHIFT_JIS,
        "ANSI_936" | "GB2312" => encoding_rs::GBK,
        "ANSI_949" | "KSC5601" => encoding_rs::EUC_KR,
        "ANSI_950" | "BIG5" => encoding_rs::BIG5,
        _ => return None,
    }))
}

/// The page has no room for the tables of these code pages, and tells that they are not known.
#[cfg(target_arch = "wasm32")]
fn two_bytes(_name: &str) -> Option<CodePage> {
    None
}
