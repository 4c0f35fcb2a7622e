"""What may stand on a part: characters, formats, check digits; and beliefs that they decide between."""
