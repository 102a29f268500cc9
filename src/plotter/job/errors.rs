//! How the errors of a job's computation become replies.

use crate::drawing::GraphError;
use crate::order::OrderError;
use crate::protocol::CommandError;
use crate::stage::{Aborted, StageError};

impl From<Aborted> for CommandError {
    fn from(_: Aborted) -> Self {
        Self::Aborted
    }
}

impl From<StageError> for CommandError {
    fn from(error: StageError) -> Self {
        match error {
            StageError::Scratch(missing) => Self::DrawingTooLarge(missing),
            StageError::Aborted => Self::Aborted,
        }
    }
}

impl From<GraphError> for CommandError {
    fn from(error: GraphError) -> Self {
        match error {
            GraphError::Scratch(missing) => Self::DrawingTooLarge(missing),
            GraphError::Aborted => Self::Aborted,
        }
    }
}

impl From<OrderError> for CommandError {
    fn from(error: OrderError) -> Self {
        match error {
            OrderError::Scratch(missing) => Self::DrawingTooLarge(missing),
            OrderError::Aborted => Self::Aborted,
            OrderError::TooManySegments => Self::TooManyLines,
            // A drawing made by `build_graph` causes neither error.
            OrderError::TourLength | OrderError::BadSegment(_) => Self::TooManyLines,
        }
    }
}
