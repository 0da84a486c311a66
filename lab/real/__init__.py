"""What the product makes of records that others measured (../shared/real beside the checkout)."""
