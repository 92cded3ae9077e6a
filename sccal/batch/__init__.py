"""Many runs in one call, none stopped by another's failure.

Nothing is imported here: worker processes start before anything heavy is.
"""
