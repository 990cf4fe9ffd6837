//! The surface of a policy: what it holds after records like its own. Nothing is stored.

use std::sync::Arc;

use crate::control::error::FieldError;
use crate::control::policy::surface::{Surface, SurfaceAxis};
use crate::service::error::ServiceError;
use crate::service::sessions::Sessions;
use crate::store::Tenant;

impl Sessions {
    /// Returns the surface of a policy after `step` periods. Each column waits for its own permit, as each point of a sweep
    /// does.
    ///
    /// # Errors
    /// There is no such policy, it has no such step, or too much work waits already.
    pub async fn surface(
        &self,
        tenant: &Tenant,
        policy: &str,
        step: usize,
        across: Option<SurfaceAxis>,
    ) -> Result<Surface, ServiceError> {
        let advisor = self.policies.advisor(tenant, policy).await?;
        let horizon = advisor.specification().problem.horizon;
        if step >= horizon {
            let rule = format!("must be at most {}: the policy advises {horizon} periods", horizon - 1);
            return Err(FieldError::new("step", step, rule).into());
        }
        let begun = advisor.clone();
        let begin = move || {
            let states = begun.surface_states(step, across);
            let advice = begun.own_advice(&states);
            (Arc::new(states), advice)
        };
        let (states, advice) = self.resolving.run(tenant, begin).await?;
        let mut columns = Vec::with_capacity(states.columns());
        for column in 0..states.columns() {
            let (advisor, states) = (advisor.clone(), states.clone());
            columns.push(self.resolving.run(tenant, move || advisor.surface_column(&states, column)).await?);
        }
        Ok(Arc::unwrap_or_clone(states).surface(&columns, advice))
    }
}
