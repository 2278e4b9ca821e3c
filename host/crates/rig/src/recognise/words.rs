//! A bone's name as words and a side.

use super::humanoid::Side;

/// Names of Japanese rigs, word by word; longer ones first.
const JAPANESE: [(&str, &str); 31] = [
    ("上半身", " spine "),
    ("下半身", " pelvis "),
    ("人差指", " index "),
    ("人差し指", " index "),
    ("つま先", " toe "),
    ("センター", " center "),
    ("グルーブ", " groove "),
    ("親指", " thumb "),
    ("人指", " index "),
    ("中指", " middle "),
    ("薬指", " ring "),
    ("小指", " little "),
    ("手首", " wrist "),
    ("足首", " ankle "),
    ("両目", " eyes "),
    ("ひじ", " elbow "),
    ("ひざ", " knee "),
    ("ＩＫ", " ik "),
    ("左", " left "),
    ("右", " right "),
    ("肘", " elbow "),
    ("膝", " knee "),
    ("腕", " upperarm "),
    ("肩", " clavicle "),
    ("足", " thigh "),
    ("首", " neck "),
    ("頭", " head "),
    ("目", " eye "),
    ("捩", " twist "),
    ("先", " end "),
    ("親", " parent "),
];

/// "mixamorig:LeftHandThumb1" → mixamorig, left, hand, thumb.
pub(crate) fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut after_small = false;
    for c in translated(name).chars() {
        if !c.is_alphabetic() || (c.is_uppercase() && after_small) {
            words.push(String::new());
        }
        if c.is_alphabetic()
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        after_small = c.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}

/// The side that a word names.
pub(super) fn side_of_word(word: &str) -> Option<Side> {
    match word {
        "left" | "l" | "lft" => Some(Side::Left),
        "right" | "r" | "rgt" => Some(Side::Right),
        _ => None,
    }
}

fn translated(name: &str) -> std::borrow::Cow<'_, str> {
    if name.is_ascii() {
        return name.into();
    }
    let mut text = name.to_owned();
    for (japanese, english) in JAPANESE {
        if text.contains(japanese) {
            text = text.replace(japanese, english);
        }
    }
    text.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fall_into_words() {
        assert_eq!(words("mixamorig:LeftHandThumb1"), ["mixamorig", "left", "hand", "thumb"]);
        assert_eq!(words("lowerarm_twist_01.l"), ["lowerarm", "twist", "l"]);
        assert_eq!(words("HeadTop_End"), ["head", "top", "end"]);
        assert_eq!(words("左ひじ"), ["left", "elbow"]);
        assert_eq!(words("右足ＩＫ"), ["right", "thigh", "ik"]);
        assert!(words("  ").is_empty());
    }
}
