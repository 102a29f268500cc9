//! Why a drawing cannot go on that a computer sent while it was drawn, in the words of the command
//! that goes on with it. The texts for other jobs name commands that the plotter refuses then.

use penup_readers::words::for_client;

/// What the drawing was begun by, so that it begins anew.
const ANEW: &str = "`penup plot FILE --port DEVICE`";

/// The reason, from the number of the refusal and the messages before it. `None` if it is the same
/// as for every job.
pub(super) fn for_sent_drawing(number: u16, messages: &[String]) -> Option<String> {
    Some(match number {
        165 => format!("the firmware has changed since the drawing began: begin anew by {ANEW}"),
        166 => {
            // The message names the setting and its value, and then the command for other jobs.
            let told: Vec<String> = messages
                .iter()
                .map(|message| message.split_once(", or begin anew").map_or(&**message, |it| it.0))
                .map(for_client)
                .collect();
            format!(
                "a setting has changed since the drawing began that decides where ink falls ({}): \
                 set it back, or begin anew by {ANEW}",
                told.join("; ")
            )
        }
        169 => "the drawing began at an origin set by hand, and the machine was homed since: put \
                the pen at that origin (`penup jog` moves it), switch the plotter off and on, then \
                `penup unlock` and `penup plot FILE --port DEVICE --resume --at-origin`"
            .to_owned(),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::for_sent_drawing;

    #[test]
    fn no_command_is_advised_that_is_refused_for_a_drawing_that_was_sent() {
        let changed = "$3 has changed since the job began: set $3=0, or begin anew by $again";
        for number in [165, 166, 169] {
            let reason = for_sent_drawing(number, &[changed.to_owned()]).unwrap_or_default();
            assert!(reason.contains("`penup plot FILE --port DEVICE"), "{reason}");
            assert!(
                !reason.contains("penup again") && !reason.contains("penup resume"),
                "{reason}"
            );
        }
        let reason = for_sent_drawing(166, &[changed.to_owned()]).unwrap_or_default();
        assert!(reason.contains("setting 3 of the machine to 0)"), "{reason}");
        assert_eq!(for_sent_drawing(7, &[]), None);
    }
}
