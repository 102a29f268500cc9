//! The numbers of the alarms, and what each means to a person.
//!
//! The table is [`AlarmEntry::of`]: an alarm without a row does not compile. `docs/errors.md` and
//! the client's messages are made from it.

use crate::host_only::HostOnly;
use crate::machine::Alarm;

/// The number of an alarm in `ALARM:N`, its cause and its cure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AlarmEntry {
    /// The number in `ALARM:N`, as in Grbl and its successors. Numbers from 100 on are penup's own.
    pub number: u8,
    /// What has happened.
    pub cause: HostOnly<&'static str>,
    /// What the user can do about it, by lines at the serial port.
    pub cure: HostOnly<&'static str>,
    /// What the user can do about it, by commands of the client.
    pub for_client: HostOnly<&'static str>,
}

impl AlarmEntry {
    /// Returns what the reply and the documentation say about an alarm: its number, its cause and
    /// what the user can do.
    pub const fn of(alarm: Alarm) -> Self {
        match alarm {
            Alarm::HardLimit => Self::new(
                1,
                "a limit switch was pressed during a move",
                "free the carriage by hand, send $X, then find the origin anew with $H; check \
                 that the drawing lies within the travel ($130, $131)",
                "free the carriage by hand, then type `penup unlock` and `penup home`; check that \
                 the drawing lies within the travel (settings 130 and 131)",
            ),
            Alarm::SoftLimit => Self::new(
                2,
                "a line of G-code led beyond the travel, so the rest of the program is refused",
                "send $X, which needs no homing, and move or shrink the drawing; $130 and $131 \
                 are the travel",
                "type `penup unlock`, which needs no homing, and move or shrink the drawing; \
                 settings 130 and 131 are the travel",
            ),
            Alarm::HomingFailed(_) => Self::new(
                9,
                "homing did not find a limit switch, or the switch stayed pressed",
                "check the switch and its cable with ? (Pn: shows what is pressed), the \
                 direction of the motor ($3), then send $H again",
                "check the switch and its cable with `penup status`, the direction of the motor \
                 (setting 3), then type `penup home`",
            ),
            Alarm::EmergencyStop => Self::new(
                10,
                "the emergency stop is pressed, or its contact is wired the other way",
                "release the stop and send $X; if nothing is pressed, set $5 for a contact that \
                 opens or closes",
                "release the stop and type `penup unlock`; if nothing is pressed, set setting 5 \
                 for a contact that opens or closes",
            ),
            Alarm::NotHomed => Self::new(
                11,
                "the machine has just started and does not know its position",
                "send $H to find the limit switches, or $X if the pen stands at the origin",
                "type `penup home`, or `penup unlock` if the pen stands at the origin",
            ),
            Alarm::Queue => Self::new(
                100,
                "a fault of the program: a step was planned for which there was no room",
                "send $X, find the origin anew, and report what was drawn and with which settings",
                "type `penup unlock`, find the origin anew, and report what was drawn and with \
                 which settings",
            ),
            Alarm::Restarted => Self::new(
                101,
                "a fault of the program: the board has started again by itself",
                "read the message before it, send $X, find the origin anew, and report the \
                 message",
                "type `penup unlock`, find the origin anew, and report the message",
            ),
        }
    }

    /// The row with this number, cause and cures.
    const fn new(
        number: u8,
        cause: &'static str,
        cure: &'static str,
        for_client: &'static str,
    ) -> Self {
        let [cause, cure, for_client] =
            [HostOnly::new(cause), HostOnly::new(cure), HostOnly::new(for_client)];
        Self { number, cause, cure, for_client }
    }
}

/// The entries of all alarms in the order of their numbers.
#[cfg(any(test, feature = "host"))]
pub fn alarm_entries() -> std::vec::Vec<AlarmEntry> {
    use crate::machine::Axis;
    let next = |alarm: Alarm| match alarm {
        Alarm::HardLimit => Some(Alarm::SoftLimit),
        Alarm::SoftLimit => Some(Alarm::HomingFailed(Axis::X)),
        Alarm::HomingFailed(_) => Some(Alarm::EmergencyStop),
        Alarm::EmergencyStop => Some(Alarm::NotHomed),
        Alarm::NotHomed => Some(Alarm::Queue),
        Alarm::Queue => Some(Alarm::Restarted),
        Alarm::Restarted => None,
    };
    core::iter::successors(Some(Alarm::HardLimit), |alarm| next(*alarm))
        .map(AlarmEntry::of)
        .collect()
}
