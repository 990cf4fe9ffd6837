//! Command-line option for the means of several assets.

use ballast::control::request::means::MeansRule;

/// Reads the means of several assets: a rule by its name, or the intensity of shrinkage.
pub fn means(text: &str) -> Result<MeansRule, String> {
    match text {
        "sample" => Ok(MeansRule::Sample {}),
        "bayes_stein" => Ok(MeansRule::BayesStein {}),
        intensity => match intensity.parse() {
            Ok(intensity) => Ok(MeansRule::Shrunk { intensity }),
            Err(_) => Err("must be sample, bayes_stein, or a share from 0 to 1".to_owned()),
        },
    }
}
