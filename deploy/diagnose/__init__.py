"""Why an agent sees nobody: facts and their judgement."""
