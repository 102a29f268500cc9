use super::*;
use penup::machine::SETTINGS;
use penup::protocol::error_samples;

#[test]
fn no_refusal_of_the_library_shows_a_word_of_the_line() {
    for refusal in error_samples() {
        let text = refusal.to_string();
        let reason = explained(refusal.number(), std::slice::from_ref(&text));
        assert!(!reason.contains('$') && !reason.contains("ctrl-X"), "{text}: {reason}");
        if error_entry(refusal.number()).is_none_or(|entry| entry.for_client.get().is_none()) {
            let words = text.split('$').skip(1).map(|part| split_after(part, |c| c == '-').0);
            for word in words {
                // Any number is written as a setting, so those of the messages must be settings.
                let is_known = SETTINGS.iter().any(|info| word.parse() == Ok(info.number()));
                let is_number = word.parse::<u16>().is_ok();
                assert!(is_known || !is_number && form(word).is_some(), "${word}: {text}");
            }
            assert!(!reason.contains("send --"), "{reason}");
        }
    }
}

#[test]
fn a_word_of_the_line_is_a_flag_or_has_words_for_it() {
    for option in OPTIONS {
        let has_words = matches!(form(option.name), Some(Form::Words(_)));
        let same = OPTIONS.iter().filter(|other| other.name == option.name);
        let is_flag = same.filter_map(|other| other.flag.get()).count() > 0;
        assert_ne!(is_flag, has_words, "{}", option.name);
    }
}

#[test]
fn switches_and_unknown_words_are_for_client() {
    assert_eq!(as_option("$fit=on"), "--fit");
    assert_eq!(as_option("$cycle=off"), "no --cycle");
    assert_eq!(as_option("v 1 2 3"), "v 1 2 3");
    assert_eq!(
        for_client("choose $see=faces, or set $130 and $131"),
        "choose --see faces, or set the travel along x (setting 130 of the machine) and along y \
         (setting 131)"
    );
    assert_eq!(
        for_client("a $newer=thing and $999 or $"),
        "a newer thing and setting 999 of the machine or "
    );
    assert_eq!(as_option("$999=1"), "setting 999 of the machine to 1");
}

#[test]
fn a_setting_that_has_changed_is_named_with_its_value() {
    let message = "$100 has changed since the job began: set $100=80.000, or begin anew by $again";
    let reason = explained(166, &[message.to_owned()]);
    assert!(reason.contains("(setting 100 of the machine) to 80.000, or begin anew"), "{reason}");
    let message = message.replace("100", "3");
    assert!(explained(166, &[message]).contains("setting 3 of the machine to 80.000"));
}
