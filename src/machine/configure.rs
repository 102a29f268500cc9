//! Changes the settings of the machine, and puts them in force.

use super::state::Activity;
use super::tool::Tool;
use super::{Machine, Setting, SettingError, Settings, Value};

impl Machine<'_> {
    /// Changes a setting. While the machine holds, raised and at rest, only the heights of the pen
    /// may change: they count from its next change on.
    ///
    /// # Errors
    /// See [`SettingError`]. On an error the setting keeps its old value.
    pub fn set(&mut self, setting: Setting, value: Value) -> Result<(), SettingError> {
        let is_allowed = match self.activity {
            Activity::Idle | Activity::Check | Activity::Alarm(_) => true,
            Activity::Hold { stopped: true, .. } => {
                matches!(setting, Setting::PenUpHeight | Setting::PenDownHeight)
            }
            _ => false,
        };
        if !is_allowed || !self.is_stopped() {
            return Err(SettingError::Busy);
        }
        let mut settings = self.settings;
        settings.set(setting, value)?;
        self.replace(settings);
        Ok(())
    }

    /// Replaces all settings, as [`Machine::set`] changes one.
    ///
    /// # Errors
    /// [`SettingError::Busy`]; the settings keep their values then.
    pub fn restore(&mut self, settings: Settings) -> Result<(), SettingError> {
        if !matches!(self.activity, Activity::Idle | Activity::Alarm(_)) || !self.is_stopped() {
            return Err(SettingError::Busy);
        }
        self.replace(settings);
        Ok(())
    }

    /// Puts settings in force, while nothing moves.
    fn replace(&mut self, settings: Settings) {
        let (page, before) = (self.position(), self.settings.kinematics());
        let backlash = self.backlash_steps();
        // While a path waits, only the heights of the pen may be changed.
        #[cfg(feature = "spread-backlash")]
        let spreads_backlash = (self.spreads_backlash()
            || settings.is_on(Setting::BacklashDistance))
            && !matches!(self.activity, Activity::Hold { .. });
        #[cfg(feature = "spread-backlash")]
        if spreads_backlash {
            self.set_motors(self.motors_now(), page);
        }
        let ink_before =
            core::mem::replace(&mut self.settings, settings).get(Setting::InkBeforePause);
        if settings.get(Setting::InkBeforePause) != ink_before {
            self.reset_ink_budget();
        }
        self.resize_backlash(backlash);
        if self.settings.kinematics() != before {
            // The pen stays where it is, but the motors' coordinates for that position change.
            self.set_position(page);
        }
        #[cfg(feature = "spread-backlash")]
        if spreads_backlash {
            self.restart_spread_backlash();
        }
        self.take_settings();
        self.configure_pulser();
    }

    /// Sets where the pen is parked, in millimetres. Unlike other settings it may change while the
    /// machine moves.
    ///
    /// # Errors
    /// See [`SettingError`]. On an error nothing changes.
    pub fn set_park(&mut self, [x, y]: [Value; 2]) -> Result<(), SettingError> {
        let mut settings = self.settings;
        settings.set(Setting::ParkX, x)?;
        settings.set(Setting::ParkY, y)?;
        self.settings = settings;
        Ok(())
    }

    /// Passes the limits, the pen positions and the override to the motion planner.
    pub(super) fn take_settings(&mut self) {
        let limits = self.settings.limits(self.pins.queue());
        self.runner.set_limits(limits, Tool::positions(&self.settings));
        self.apply_override();
    }

    /// Passes the pulse width, the pin inversion, the height of the raised pen and the rule for
    /// braking to the step interrupt.
    /// Call it only while nothing moves.
    pub(super) fn configure_pulser(&mut self) {
        self.pins.configure(
            self.settings.microseconds_as_ticks(Setting::StepPulse),
            self.settings.whole(Setting::InvertDirections) as u8, // at most 7
            Tool::positions(&self.settings).up_height,
        );
        let (rule, _) = self.settings.brake(self.pins.queue());
        self.runner.set_brake(rule);
        self.pins.brake().set_rule(rule);
    }

    /// The greatest speed of the machine, in mm/min, if its settings ask for a greater one: from
    /// that it could not stop within the steps that wait for the interrupt, and would have to brake
    /// harder than it may whenever the main loop is late. `None` if the settings hold.
    pub fn held_to(&self) -> Option<Value> {
        self.settings.brake(self.pins.queue()).1
    }
}
