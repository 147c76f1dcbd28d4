//! Text by Windows-1252, of which Latin-1 is a part.

/// Letters of the bytes 0x80 to 0x9F; zero: none.
const HIGH: [char; 32] = [
    '€', '\0', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\0', 'Ž', '\0', '\0', '‘',
    '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\0', 'ž', 'Ÿ',
];

/// The text of a cell; none where a byte stands for no letter.
pub fn text(content: &[u8]) -> Option<String> {
    content
        .iter()
        .map(|&byte| match byte {
            0x80..=0x9F => HIGH.get(usize::from(byte - 0x80)).copied(),
            _ => Some(char::from(byte)),
        })
        .map(|letter| letter.filter(|&found| found != '\0'))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::text;

    #[test]
    fn letters_and_bytes_that_are_none() {
        assert_eq!(text(b"r\xFCckw\xE4rts \x80"), Some("rückwärts €".into()));
        assert_eq!(text(b"a\x81"), None);
        assert_eq!(text(b"a\0"), None);
    }
}
