//! The address of a PostgreSQL database, including its password.

use std::fmt;
use std::str::FromStr;

use sqlx::postgres::PgConnectOptions;
use thiserror::Error;

/// A parsed `postgres://user:password@host:port/database`. Missing parts come from libpq's variables (`PGPASSWORD`,
/// ...) and password file. It prints without the password.
#[derive(Clone)]
pub struct PostgresUrl(Box<PgConnectOptions>);

/// The reason why a text is no such address. The text is not shown, because it may hold a password.
#[derive(Debug, Error)]
pub enum UrlError {
    #[error("the store must be given as postgres://user:password@host:port/database")]
    Scheme,
    #[error("the address of the store cannot be read")]
    Address { source: sqlx::Error },
}

impl PostgresUrl {
    pub(super) fn options(&self) -> PgConnectOptions {
        match self.0.get_application_name() {
            Some(_) => (*self.0).clone(),
            None => (*self.0).clone().application_name("ballast"),
        }
    }
}

impl FromStr for PostgresUrl {
    type Err = UrlError;

    fn from_str(text: &str) -> Result<Self, UrlError> {
        if !text.starts_with("postgres://") && !text.starts_with("postgresql://") {
            return Err(UrlError::Scheme);
        }
        let options = PgConnectOptions::from_str(text).map_err(|source| UrlError::Address { source })?;
        Ok(PostgresUrl(Box::new(options)))
    }
}

impl fmt::Display for PostgresUrl {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (options, user) = (&self.0, self.0.get_username());
        let database = options.get_database().unwrap_or(user);
        match options.get_socket() {
            Some(socket) => write!(formatter, "postgres://{user}@{}/{database}", socket.display()),
            None => write!(formatter, "postgres://{user}@{}:{}/{database}", options.get_host(), options.get_port()),
        }
    }
}

impl fmt::Debug for PostgresUrl {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_password_is_never_printed() {
        let url: PostgresUrl = "postgres://ballast:secret@db.example:5433/facts".parse().unwrap();
        assert_eq!(format!("{url} {url:?}"), ["postgres://ballast@db.example:5433/facts"; 2].join(" "));
        for refused in ["mysql://u:secret@h/d", "secret", "postgres://u:secret@h:secret/d"] {
            let error = refused.parse::<PostgresUrl>().unwrap_err();
            let causes = std::iter::successors(std::error::Error::source(&error), |cause| cause.source());
            let text = causes.fold(format!("{error} {error:?}"), |text, cause| format!("{text} {cause}"));
            assert!(!text.contains("secret"), "{text}");
        }
    }

    #[test]
    fn every_mode_of_encryption_is_taken() {
        for mode in ["disable", "prefer", "require", "verify-ca", "verify-full"] {
            assert!(
                format!("postgres://h/d?sslmode={mode}&sslrootcert=ca.pem").parse::<PostgresUrl>().is_ok(),
                "{mode}"
            );
        }
        assert!("postgres://h/d?sslmode=verify-ful".parse::<PostgresUrl>().is_err());
    }
}
