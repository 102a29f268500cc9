//! The setup of a polargraph. Its pen can only be moved along a line once the plotter knows where
//! the motors are, so the machine is measured and the pen is brought to the origin first.

use super::answers::say;
use super::{End, Machine, Setup, expect_origin, reopened};
use crate::cli::PlotterArgs;
use crate::link::SerialLink;
use crate::machine_settings::{AssignedSetting, value};
use crate::sender::Sender;
use penup::machine::Setting;
use penup_job::protocol::HOME;
use std::sync::atomic::AtomicBool;

/// The bounds of a setting.
fn bounds(setting: Setting) -> [f64; 2] {
    let info = setting.info();
    [info.least, info.greatest].map(|bound| bound.to_num::<f64>())
}

impl Setup<'_> {
    /// Leads through the whole setup of a polargraph.
    pub(super) fn polargraph_parts(
        &mut self,
        args: &PlotterArgs,
        mut link: SerialLink,
        settings: &[AssignedSetting],
        interrupt: &AtomicBool,
    ) -> Result<(), End> {
        self.on(&mut link, interrupt, |setup, sender| setup.measure_polargraph(sender, settings))?;
        let mut link = self.hang_at_origin(args, link, interrupt)?;
        self.on(&mut link, interrupt, |setup, sender| {
            say("3 of 5: directions of the motors, the left one being that of x.");
            let inverting = value(settings, Setting::InvertDirections) as u8;
            setup.find_directions(sender, Machine::Polargraph, inverting)?;
            setup.pen_heights(sender, settings, 4)?;
            if value(settings, Setting::Homing) != 0.0 {
                setup.answers.ask("Press Enter to pull both belts in to their switches.")?;
                sender.ask(HOME)?;
                sender.wait_until_ready()?;
            }
            setup.draw_test(sender)
        })
    }

    /// Asks for the places of the motors and of the page, and for the belts.
    fn measure_polargraph(
        &mut self,
        sender: &mut Sender<'_>,
        settings: &[AssignedSetting],
    ) -> Result<(), End> {
        say("1 of 5: the machine's measures. All are in mm; Enter keeps what the plotter has.");
        let width = self.ask_measure(
            "How far apart are the two points where the belts leave the motors",
            value(settings, Setting::AnchorWidth),
            bounds(Setting::AnchorWidth),
        )?;
        self.set(sender, Setting::AnchorWidth, width)?;
        let [least, _] = bounds(Setting::AnchorLeft);
        let left = self.ask_measure(
            "How far to the right of the left one is the origin, the sheet's lower left corner",
            value(settings, Setting::AnchorLeft).min(width),
            [least, width],
        )?;
        self.set(sender, Setting::AnchorLeft, left)?;
        let height_of_page = value(settings, Setting::TravelY);
        let height = self.ask_measure(
            "How far below the two points is the origin",
            value(settings, Setting::AnchorHeight),
            bounds(Setting::AnchorHeight),
        )?;
        let page_width = self.ask_measure(
            "How wide is the area to draw on, from the origin to the right",
            value(settings, Setting::TravelX),
            bounds(Setting::TravelX),
        )?;
        self.set(sender, Setting::TravelX, page_width)?;
        // The belts cannot hold the pen at the height of the motors.
        let [least, _] = bounds(Setting::TravelY);
        let page_height = self.ask_measure(
            "How high is it, from the origin up",
            height_of_page.min(height - 1.0),
            [least, height - 1.0],
        )?;
        // The area must never reach up to the motors, so the order of the two changes matters.
        let mut two = [(Setting::AnchorHeight, height), (Setting::TravelY, page_height)];
        if height <= height_of_page {
            two.reverse();
        }
        for (setting, measure) in two {
            self.set(sender, setting, measure)?;
        }
        let steps = value(settings, Setting::StepsPerMmX);
        let question = format!(
            "How many mm of belt does a turn of a motor pull in: the pulley's teeth times their \
             distance? ({steps} steps in a mm now; Enter keeps them)"
        );
        if let Some(turn) = self.answers.number(&question, [1.0, 1000.0])? {
            let [least, most] = bounds(Setting::StepsPerMmX).map(|bound| bound * turn);
            let question = "How many steps has such a turn, with the microsteps of the driver?";
            if let Some(steps) = self.answers.number(question, [least.ceil(), most.floor()])? {
                self.set(sender, Setting::StepsPerMmX, (steps / turn * 1000.0).round() / 1000.0)?;
            }
        }
        if value(settings, Setting::Homing) != 0.0 {
            let question = format!(
                "How long is a belt, from the motor to the pen, when it has left its switch by the \
                 {} mm of homing ($27)",
                value(settings, Setting::HomingPullOff)
            );
            let belt = self.ask_measure(
                &question,
                value(settings, Setting::HomedBelt),
                bounds(Setting::HomedBelt),
            )?;
            self.set(sender, Setting::HomedBelt, belt)?;
        }
        Ok(())
    }

    /// Asks for a measure in mm, and says what it is now.
    fn ask_measure(&self, question: &str, now: f64, bounds: [f64; 2]) -> Result<f64, End> {
        let question = format!("{question}? ({now} now)");
        Ok(self.answers.number(&question, bounds)?.unwrap_or(now))
    }

    /// Has the pen brought to the origin, where the plotter takes it to be when it starts.
    fn hang_at_origin(
        &mut self,
        args: &PlotterArgs,
        link: SerialLink,
        interrupt: &AtomicBool,
    ) -> Result<SerialLink, End> {
        say("2 of 5: the origin, the sheet's lower left corner.");
        drop(link);
        self.answers.ask(
            "Switch the plotter off, bring the pen by hand to the sheet's lower left corner, with \
             both belts tight, switch it on, and press Enter.",
        )?;
        let mut link = reopened(args)?;
        self.on(&mut link, interrupt, |_, sender| expect_origin(sender))?;
        Ok(link)
    }
}
